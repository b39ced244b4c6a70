"""`python -m cfddem`: the command line, for environments without the `cfddem` script on the path."""

from cfddem.cli.app import main

if __name__ == "__main__":
    main()
