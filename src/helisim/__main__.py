"""`python -m helisim`."""

import sys

from helisim.cli import main

if __name__ == "__main__":
    sys.exit(main())
