"""Hatchling's hook: packs of kernels go into the wheel, the first command need not compile."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class Packs(BuildHookInterface):  # type: ignore[misc]
    """Builds packs for the processors of this machine's family, if the wheel is no editable one."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build them beside the sources; a wheel without packs works, too."""
        if version == "editable" or os.environ.get("DER_PACKS") == "off":
            return
        folder = Path(self.root, "der", "packs", "built")
        path = os.pathsep.join([self.root, *filter(None, [os.environ.get("PYTHONPATH")])])
        words = [sys.executable, "-m", "der.packs.build", "--all", str(folder)]
        done = subprocess.run(words, cwd=self.root, env=os.environ | {"PYTHONPATH": path})
        if done.returncode:
            self.app.display_warning("kernels were not compiled: the first command will do it")
            return
        for file in folder.glob("*.pack"):
            build_data["force_include"][str(file)] = f"der/packs/built/{file.name}"
        build_data["pure_python"] = False
        build_data["infer_tag"] = True
