"""What pyproject.toml cannot say: the scenarios, which lie beside the packages, go into one of them."""

from setuptools import find_packages, setup

PACKAGES = ("cybership*", "fmus*", "cosim*", "diagnosis*", "studies*")
SHIPPED = {"cosim.shipped": "scenarios", "cosim.shipped.campaigns": "scenarios/campaigns"}

setup(
    packages=[*find_packages(include=PACKAGES), *SHIPPED],
    package_dir=SHIPPED,
)
