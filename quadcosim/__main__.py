"""`python -m quadcosim`: the command."""

from orchestration.command.start import main

main()
