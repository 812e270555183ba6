"""Build FMUs without Python inside, with the mathematics that is asked for.

MATHEMATICS FOLDER [--root ROOT] MODULE:CLASS …
"""

import functools
import sys
from typing import cast

from fmu_kit.compiler.pack.building import build
from fmu_kit.compiler.pack.c_compiler import Mathematics
from fmu_kit.packaging import main

if __name__ == "__main__":
    chosen, *arguments = sys.argv[1:]
    mathematics = cast(Mathematics, chosen)
    sys.exit(main(arguments, functools.partial(build, mathematics=mathematics)))
