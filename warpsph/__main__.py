"""`python -m warpsph`: the command line."""

from warpsph.cli import main

if __name__ == "__main__":
    main()
