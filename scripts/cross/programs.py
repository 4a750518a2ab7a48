"""Outside programs and packages: how they are called, and their versions."""

import shutil


def program(setting, name):
    """How an outside program is called, and its version; none where it is not there."""
    call = getattr(setting.given, name)
    default = {"pdal": "pdal", "cloudcompare": "CloudCompare", "octomap_tools": ""}[name]
    if call is None and shutil.which(default or "bt2vrml"):
        call = default
    return call


def labelled(setting, name, reader=None):
    """A reader with its package's version."""
    versions = setting.known = getattr(setting, "known", None) or setting.versions()
    return f"{reader or name} {versions[name.lower()]}"
