"""What pyproject.toml cannot say: files next to the packages go into three of them."""

from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py

PACKAGES = ("cybership*", "fmus*", "fmucheck*", "cosim*", "diagnosis*", "studies*", "thesis*")
SHIPPED = {
    "cosim.shipped": "scenarios",
    "cosim.shipped.campaigns": "scenarios/campaigns",
    "fmus.shipped": "ships",
}


class WithGlossary(build_py):
    """The packages, and the glossary that reports link to."""

    def run(self) -> None:
        super().run()
        if not self.editable_mode:
            self.copy_file("docs/glossary.md", str(Path(self.build_lib) / "diagnosis" / "report"))


setup(
    packages=[*find_packages(include=PACKAGES), *SHIPPED],
    package_dir=SHIPPED,
    cmdclass={"build_py": WithGlossary},
)
