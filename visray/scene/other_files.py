"""What a file is that is given as a scene and is none: a picture, or a Python program."""

from pathlib import Path

# How the bytes of pictures begin: PNG, EXR, JPEG, GIF, TIFF of both byte orders, WebP, HDR.
PICTURES = (b"\x89PNG", b"v/1\x01", b"\xff\xd8\xff", b"GIF8", b"II*\0", b"MM\0*", b"RIFF", b"#?RADIANCE", b"#?RGBE")


def other_file(path: Path, content: bytes) -> str:
    """What the file is, and what would be right; "" if it may be a scene."""
    if content.startswith(PICTURES):
        scene = path.with_suffix(".json")
        right = f"give its scene, {scene}" if scene != path and scene.is_file() else "give the .json file of a scene"
        return f"is a picture, not a scene; {right}"
    if path.suffix.lower() == ".py" and not content.lstrip().startswith(b"{"):
        return f"is a Python program, not a scene; run it: python {path}"
    return ""
