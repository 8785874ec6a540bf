"""Reads what Tyndall wrote with Pillow and OpenEXR: the same picture in every format, layers that mean what the manual says.

usage: pictures.py TYNDALL FOLDER
"""

import subprocess
import sys

import numpy as np
import OpenEXR
from PIL import Image

tyndall, folder = sys.argv[1:]


def render(name, *options):
    path = f"{folder}/{name}"
    view = ["--size", "120x90", "--samples", "4", "--background", "none", "-q"]
    subprocess.run([tyndall, "render", "synthetic:packed?n=2000", "-o", path, *view, *options], check=True)
    return path


def srgb(linear):
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)


png = np.asarray(Image.open(render("a.png")), dtype=float) / 255
sixteen = Image.open(render("b.png", "--bits", "16"))
with OpenEXR.File(render("c.exr")) as file:
    channels = {name: channel.pixels for name, channel in file.channels().items()}
    header = dict(file.header())
color = channels["RGBA"] if "RGBA" in channels else np.stack([channels[name] for name in "RGBA"], axis=-1)
depth, place = channels["depth"], channels["id"]

assert png.shape == (90, 120, 4) and sixteen.size == (120, 90), (png.shape, sixteen.size)
alpha = color[..., 3]
straight = np.where(alpha[..., None] > 0, color[..., :3] / np.maximum(alpha, 1e-9)[..., None], 0)
worst = np.abs(srgb(np.clip(straight, 0, 1)) - png[..., :3])[alpha > 0].max()
assert worst < 1.01 / 255, f"PNG and EXR differ by {worst * 255} of 255 steps"
assert np.abs(alpha - png[..., 3]).max() < 1.01 / 255

met = place >= 0
assert met.any() and not met.all() and place.max() < 2000
assert (np.isfinite(depth) == met).all() and (depth[met] > 0).all()
assert any("tyndall" in str(value).lower() for value in header.values()), header
print(f"{met.sum()} of {met.size} pixels meet a particle; PNG and EXR agree to {worst * 255:.2f} steps of 255")
