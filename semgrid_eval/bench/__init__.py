"""How fast everything is on this machine, beside what is promised."""
