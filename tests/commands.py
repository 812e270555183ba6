"""What the tests of the command line share."""

import subprocess
from collections.abc import Callable

Done = subprocess.CompletedProcess[str]
"""A command that has ended, in a process of its own or in this one."""
Main = Callable[..., Done]
"""Runs the command in this process, through the fixture `main`."""
