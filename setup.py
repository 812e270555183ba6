"""What a wheel has beside the packages: the examples and studies that `quadcosim examples` writes."""

from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

FOLDERS, KEPT = ("examples", "studies", "gains"), (".c", ".csv", ".h", ".md", ".py", ".toml")
"""As in orchestration/components/scaffold/examples.py"""


class WithExamples(build_py):
    """Puts them where `orchestration/components/scaffold/examples.py` looks for them."""

    def run(self) -> None:
        super().run()
        if self.editable_mode:
            return
        for folder in FOLDERS:
            for file in sorted(Path(folder).rglob("*")):
                if file.suffix in KEPT:
                    to = Path(self.build_lib, "orchestration", "components", "scaffold", "shipped", file)
                    self.mkpath(str(to.parent))
                    self.copy_file(str(file), str(to))


setup(cmdclass={"build_py": WithExamples})
