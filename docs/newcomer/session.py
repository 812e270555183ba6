"""An interactive Python session: each line of standard input is a block in JSON, run in one namespace.

Each is answered by a line on the given descriptor: null, or the traceback as a text. Run as a file, not as a module.
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
        failure = None
        try:
            exec(compile(json.loads(line), "<page>", "exec"), namespace)
        except BaseException:  # including those that would end the process
            failure = traceback.format_exc()
        sys.stdout.flush()
        answers.write(json.dumps(failure) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
