"""The tests of the add-on may ask for what those of genie-sim may: ``tests/conftest.py`` of the
checkout.
"""

pytest_plugins = ["tests.conftest"]
