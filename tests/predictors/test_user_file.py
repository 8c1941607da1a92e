"""A model file of the user's: its folder is on the import path, and its own modules are the ones that it gets."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from shipbench.errors import InputError
from shipbench.predictors._user_file import class_from_file


def _model(folder, gain):
    folder.mkdir(exist_ok=True)
    (folder / "helpers_of_test.py").write_text(f"GAIN = {gain}")
    (folder / "model.py").write_text("import helpers_of_test\nclass Model:\n    gain = helpers_of_test.GAIN\n")
    return folder / "model.py"


def test_modules_of_two_folders_and_of_two_versions_are_not_mixed_up(tmp_path):
    path = list(sys.path)
    assert class_from_file(_model(tmp_path / "a", 1.0), "Model").gain == 1.0
    assert class_from_file(_model(tmp_path / "b", 2.0), "Model").gain == 2.0
    assert class_from_file(_model(tmp_path / "b", 33.0), "Model").gain == 33.0
    assert sys.path == path


def test_the_code_of_a_model_is_its_file_and_what_it_imports_of_the_users_own(tmp_path):
    file = _model(tmp_path / "a", 1.0)
    (tmp_path / "a" / "not_imported.py").write_text("x = 1")
    (tmp_path / "elsewhere" / "kit").mkdir(parents=True)
    for name in ("__init__", "used", "later"):
        (tmp_path / "elsewhere" / "kit" / f"{name}.py").write_text("x = 1")
    with file.open("a") as f:
        f.write("import json, numpy, kit.used\n")
    code = (
        "import sys; from pathlib import Path; from shipbench.predictors._user_file import class_from_file, "
        "code_of; p = Path(sys.argv[1]);"
        "class_from_file(p, 'Model'); print(*code_of(p))"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([*filter(None, sys.path), str(tmp_path / "elsewhere")])}
    done = subprocess.run(
        [sys.executable, "-P", "-c", code, str(file)], capture_output=True, text=True, check=True, env=environment
    )
    assert done.stdout.split() == ["helpers_of_test.py", "kit/__init__.py", "kit/later.py", "kit/used.py", "model.py"]


def test_an_unknown_class_is_told_with_those_that_are_there(tmp_path):
    with pytest.raises(InputError, match=r"unknown class or function in .*model.py 'Modl'. Did you mean 'Model'"):
        class_from_file(_model(tmp_path / "a", 1.0), "Modl")
