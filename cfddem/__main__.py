"""`python -m cfddem`: the command line, where its script is not on the path."""

from cfddem.cli import main

if __name__ == "__main__":
    main()
