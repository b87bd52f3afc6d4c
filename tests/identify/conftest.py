"""A made-up fit, for tests of what is decided from one."""

from tests.made_up import made_up as made_up  # a fixture
