"""Tables, plots and the page, made from result files alone."""
