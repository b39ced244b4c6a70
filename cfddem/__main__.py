"""`python -m cfddem`: the command line, for environments without the `cfddem` script on the path.

Python itself puts the working folder first where it looks for modules; `python -P -m cfddem` and the script do not.
The folder is left out again here, which is too late for the few modules that Python has imported by now.
"""

import os
import sys

if not sys.flags.safe_path and sys.path[0] != os.path.dirname(os.path.dirname(os.path.abspath(__file__))):
    del sys.path[0]

from cfddem.cli.app import main

if __name__ == "__main__":
    main()
