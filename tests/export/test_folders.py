"""A folder in place of a file."""

import pytest

from jaxdamp.dampers import Linear
from jaxdamp.export import from_json, to_json


def test_a_folder_is_no_file(tmp_path):
    for call in (lambda: to_json(Linear(2.0), tmp_path), lambda: from_json(tmp_path)):
        with pytest.raises(ValueError, match=r"must be a file, but is the folder .* Add the name of the file"):
            call()
    assert not list(tmp_path.iterdir())
