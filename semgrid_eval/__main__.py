"""`python -m semgrid_eval`: the command line, where the command itself is not on the path."""

from semgrid_eval.cli.main import main

if __name__ == "__main__":
    main()
