"""Python as somebody has it open beside a page: each line of standard input is a block in JSON, run in one namespace.

Each is answered by a line on the descriptor given: null, or the traceback as a text. Run as a file, not as a module.
"""

import json
import os
import sys
import traceback


def main() -> None:
    """Answer until the input ends."""
    answers = os.fdopen(int(sys.argv[1]), "w")
    sys.path.insert(0, "")
    namespace: dict[str, object] = {"__name__": "__main__"}
    for line in sys.stdin:
        said = None
        try:
            exec(compile(json.loads(line), "<page>", "exec"), namespace)
        except BaseException:  # also one that would end the process
            said = traceback.format_exc()
        sys.stdout.flush()
        answers.write(json.dumps(said) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
