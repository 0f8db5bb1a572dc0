# SPDX-License-Identifier: Apache-2.0
"""Build ROS message packages that are not available as wheels, with the generators from ROS's wheels.

``python interfaces_builder.py DEFINITIONS FOLDER`` prints the entry for ``PYTHONPATH``. It needs compilers for C and
C++, and Python's headers.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import io
import json
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gdfe_ros.errors import GdfeError

_KINDS = ("msg", "srv", "action")
_TYPE_SUPPORTS = ("rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c")
_LINKED = (
    "*__rosidl_generator_c", "*__rosidl_generator_py", "*__rosidl_typesupport_c", "rosidl_runtime_c",
    "rosidl_typesupport_c", "fastcdr", "rmw", "rcutils",
    *(f"{start}{name}" for name in _TYPE_SUPPORTS for start in ("*__", "")),
)  # fmt: skip


def build_interfaces(definitions: Path, folder: Path) -> Path:
    """Build a Python package of messages, services and actions; return its entry for ``PYTHONPATH``.

    A package that was built from the same definitions is used again.

    Args:
        definitions: directory with msg/, srv/ and action/; its name is the name of the package.
        folder: directory for all built packages, which later runs use again. Each package has its own entry for
            ``PYTHONPATH``, so that a process that imports one never finds another that is still being built.

    Raises:
        GdfeError: ROS is not installed from wheels, there is no compiler, or the compiler failed.
    """
    folder = folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    place = folder / definitions.name
    target = place / definitions.name
    digest, stored = _digest(definitions), target / "digest"
    with _locked(folder / f"{definitions.name}.lock"):
        if not stored.exists() or stored.read_text(encoding="utf-8") != digest:
            if not (Path(sys.prefix) / "share" / "rosidl_generator_py").is_dir():
                raise GdfeError(f"{sys.prefix} has no generators of ROS's wheels; install gdfe_ros[ros] there")
            shutil.rmtree(place, ignore_errors=True)
            _Builder(definitions.resolve(), target).build()
            (target / "__init__.py").touch()
            stored.write_text(digest, encoding="utf-8")
    return place


def _digest(definitions: Path) -> str:
    """Return a digest of the names and contents of all definitions."""
    found = hashlib.sha256()
    for path in sorted(path for kind in _KINDS for path in definitions.glob(f"{kind}/*")):
        found.update(f"{path.relative_to(definitions)}\n{path.read_text(encoding='utf-8')}\n".encode())
    return found.hexdigest()


class _Builder:
    """Builds the shared libraries of one package from its message definitions.

    Args:
        definitions: directory of the definitions.
        target: directory of the package.
    """

    def __init__(self, definitions: Path, target: Path) -> None:
        self._definitions, self._target, self._name = definitions, target, definitions.name
        self._prefix = Path(sys.prefix)
        self._share = self._prefix / "share"

    def build(self) -> None:
        """Generate the sources, and compile and link them."""
        with contextlib.redirect_stdout(io.StringIO()):  # the generators print every file name
            self._generate()
        for support in _TYPE_SUPPORTS:
            self._link(f"lib{self._name}__{support}.so", self._sources(support))
        sources = [
            source
            for generator in ("rosidl_generator_c", "rosidl_typesupport_c", "rosidl_generator_py")
            for source in self._sources(generator)
        ]
        suffix = sysconfig.get_config_var("EXT_SUFFIX")
        beside = [f"-l:lib{self._name}__{support}.so" for support in _TYPE_SUPPORTS]
        # The module links to the type supports, so that the lookup by name at run time finds them loaded.
        options = ["-L.", "-Wl,--no-as-needed", *beside, "-Wl,--as-needed", "-Wl,-rpath,$ORIGIN"]
        self._link(f"{self._name}_s__rosidl_typesupport_c{suffix}", sources, *options)
        for path in (self._build / "rosidl_generator_py" / self._name).iterdir():
            path.rename(self._target / path.name)
        shutil.rmtree(self._build)

    @property
    def _build(self) -> Path:
        return self._target / "build"

    def _sources(self, generator: str) -> list[Path]:
        return sorted(path for path in (self._build / generator).rglob("*.c*") if path.suffix in (".c", ".cpp"))

    def _generate(self) -> None:
        import rosidl_generator_c
        import rosidl_generator_py
        import rosidl_typesupport_c
        import rosidl_typesupport_fastrtps_c
        import rosidl_typesupport_introspection_c
        from rosidl_adapter import convert_to_idl
        from rosidl_generator_type_description import generate_type_hash

        idl = self._build / "idl"
        relative = [
            path.relative_to(self._definitions) for kind in _KINDS for path in self._definitions.glob(f"{kind}/*")
        ]
        for path in relative:
            convert_to_idl(self._definitions, self._name, path, idl)
        self._idl = [path.with_suffix(".idl") for path in sorted(relative)]
        packages = [path.parent for path in self._share.glob("*/msg")] + [
            path.parent for path in self._share.glob("*/srv")
        ]
        generate_type_hash(
            self._arguments("rosidl_generator_type_description", include_paths=[f"{p.name}:{p}" for p in packages])
        )
        rosidl_generator_c.generate_c(self._arguments("rosidl_generator_c"))
        rosidl_typesupport_fastrtps_c.generate_typesupport_fastrtps_c(self._arguments("rosidl_typesupport_fastrtps_c"))
        rosidl_typesupport_introspection_c.generate_c(self._arguments("rosidl_typesupport_introspection_c"))
        rosidl_typesupport_c.generate_c(self._arguments("rosidl_typesupport_c"), list(_TYPE_SUPPORTS))
        rosidl_generator_py.generate_py(self._arguments("rosidl_generator_py"), ["rosidl_typesupport_c"])

    def _arguments(self, generator: str, **more: list[str]) -> str:
        """Write a generator's header of visibility macros and the file of its arguments; return the file's path."""
        output, templates = self._build / generator / self._name, self._share / generator / "resource"
        output.mkdir(parents=True)
        for template in templates.glob("*__visibility_control.h.in"):
            (output / "msg").mkdir(exist_ok=True)
            text = template.read_text(encoding="utf-8").replace("@PROJECT_NAME@", self._name)
            text = text.replace("@PROJECT_NAME_UPPER@", self._name.upper())
            (output / "msg" / template.stem).write_text(text, encoding="utf-8")
        hashes = self._build / "rosidl_generator_type_description" / self._name
        arguments = {
            "package_name": self._name,
            "idl_tuples": [f"{self._build / 'idl'}:{path}" for path in self._idl],
            "output_dir": str(output),
            "template_dir": str(templates),
            "target_dependencies": [],
            "ros_interface_dependencies": [],
            "type_description_tuples": [f"{path}:{hashes / path.with_suffix('.json')}" for path in self._idl],
            **more,
        }
        file = self._build / f"{generator}.json"
        file.write_text(json.dumps(arguments), encoding="utf-8")
        return str(file)

    def _link(self, name: str, sources: list[Path], *options: str) -> None:
        """Compile sources into a shared library of the package."""
        folders = [
            self._build / generator for generator in ("rosidl_generator_c", "rosidl_generator_py", *_TYPE_SUPPORTS)
        ]
        folders += [path for path in (self._prefix / "include").iterdir() if path.is_dir()]
        folders += [self._prefix / "include", Path(sysconfig.get_paths()["include"]), Path(np.get_include())]
        common = ["-O0", "-w", "-fPIC", *(f"-I{path}" for path in folders)]
        folder = self._build / name
        folder.mkdir()
        # In C++ one unit for all: headers, the main cost, are read once. In C the names would collide.
        unit = folder / "unit.cpp"
        unit.write_text("".join(f'#include "{path}"\n' for path in sources if path.suffix == ".cpp"), encoding="utf-8")
        self._run("g++", *common, "-c", str(unit), folder=folder)
        # A message and a service may have the same name, and so have their sources: each folder has its own objects.
        plain = [path for path in sources if path.suffix == ".c"]
        for number, parent in enumerate(sorted({path.parent for path in plain})):
            (folder / str(number)).mkdir()
            beside = [str(path) for path in plain if path.parent == parent]
            self._run("gcc", *common, "-c", *beside, folder=folder / str(number))
        objects = [str(path) for path in sorted(folder.rglob("*.o"))]
        libraries = [
            f"-l:{path.name}" for pattern in _LINKED for path in (self._prefix / "lib").glob(f"lib{pattern}.so")
        ]
        named = f"-Wl,-soname,{name}"
        self._run(
            "g++",
            "-shared",
            *objects,
            "-o",
            name,
            named,
            *options,
            f"-L{self._prefix / 'lib'}",
            *libraries,
            folder=self._target,
        )

    def _run(self, *command: str, folder: Path) -> None:
        try:
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        except FileNotFoundError as error:
            raise GdfeError(f"the messages of {self._name} need a compiler, {command[0]}: {error}") from error
        if done.returncode:
            raise GdfeError(f"{command[0]} failed on the messages of {self._name}:\n{done.stderr[-2000:]}")


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Lock a file exclusively during the context, because several test workers may build the same package."""
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


if __name__ == "__main__":
    print(build_interfaces(Path(sys.argv[1]), Path(sys.argv[2])))
