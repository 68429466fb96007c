"""What pyproject.toml cannot say: the scenarios and ships beside the packages go into two of them."""

from setuptools import find_packages, setup

PACKAGES = ("cybership*", "fmus*", "fmucheck*", "cosim*", "diagnosis*", "studies*", "thesis*")
SHIPPED = {
    "cosim.shipped": "scenarios",
    "cosim.shipped.campaigns": "scenarios/campaigns",
    "fmus.shipped": "ships",
}

setup(
    packages=[*find_packages(include=PACKAGES), *SHIPPED],
    package_dir=SHIPPED,
)
