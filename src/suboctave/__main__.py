"""`python -m suboctave`: the command line."""

from suboctave.study.cli import main

if __name__ == "__main__":
    main()
