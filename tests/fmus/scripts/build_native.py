"""Build FMUs without Python inside, with the mathematics that is asked for.

MATHEMATICS FOLDER [--root ROOT] MODULE:CLASS …
"""

import functools
import sys

from fmu_kit.native.building import build
from fmu_kit.packaging import main

if __name__ == "__main__":
    mathematics, *arguments = sys.argv[1:]
    sys.exit(main(arguments, functools.partial(build, mathematics=mathematics)))
