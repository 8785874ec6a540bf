"""Reads what Tyndall wrote with Pillow, OpenEXR and PyAV: the same picture in every format, layers that mean what the manual says, movies
that show it.

usage: pictures.py TYNDALL FOLDER
"""

import subprocess
import sys

import av
import numpy as np
import OpenEXR
from PIL import Image, ImageSequence

tyndall, folder = sys.argv[1:]


def render(name, *options, background="none"):
    path = f"{folder}/{name}"
    view = ["--size", "120x90", "--samples", "4", "--background", background, "-q"]
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

turn = ["--orbit", "360", "--frame-count", "5"]
render("s.%d.png", *turn, background="white")
white = [np.asarray(Image.open(f"{folder}/s.{k}.png"), dtype=float) for k in range(5)]
for encoder in ["built-in", "auto"]:
    with av.open(render(f"{encoder}.mp4", *turn, "--encoder", encoder, "--fps", "10", background="white")) as movie:
        stream = movie.streams.video[0]
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        frames = list(movie.decode(stream))
    assert [round(float(frame.time), 3) for frame in frames] == [0.0, 0.1, 0.2, 0.3, 0.4]
    # Players take colors by the tags that the file has.
    assert frames[0].colorspace == 1 and frames[0].color_range == 1, (frames[0].colorspace, frames[0].color_range)
    error = max(np.abs(frame.to_ndarray(format="rgb24") - still).mean() for frame, still in zip(frames, white))
    assert error < 6, f"{encoder}: {error} of 255"
    print(f"MP4, {encoder}: pictures differ by at most {error:.2f} of 255 in the mean")
for name, limit in [("t.webp", 0), ("t.gif", 6)]:
    with Image.open(render(name, *turn, "--fps", "10", background="white")) as movie:
        assert movie.n_frames == 5 and movie.info["loop"] == 0, movie.info
        frames, lasts = [], []
        for frame in ImageSequence.Iterator(movie):
            frames.append(np.asarray(frame.convert("RGB"), dtype=float))
            lasts.append(frame.info["duration"])
    assert lasts == [100] * 5, lasts
    error = max(np.abs(frame - still).mean() for frame, still in zip(frames, white))
    assert error <= limit, f"{name}: {error} of 255"
