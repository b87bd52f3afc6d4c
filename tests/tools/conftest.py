"""Results made up by hand, for the tests of this folder."""

from tests.made_up import made_up as made_up  # a fixture
