"""`python -m warpsph`: the command line of cli.py."""

from warpsph.cli import main

if __name__ == "__main__":
    main()
