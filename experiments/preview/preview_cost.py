"""Measures what a viewer of the live page costs, and how often it gets a new image.

    python3 experiments/preview/preview_cost.py PRPF SCENE [--time SECONDS] [--runs N] [--views raw,filtered]
        [--quality PRESET] [--resolution WxH]

Renders the scene with the same time budget, alternately without a live page and with one viewer, which receives
every frame as soon as it is sent. The viewer is no browser, whose drawing would cost time of its own. Prints medians
over the runs: ratio of the samples with and without a viewer, seconds from the printed address to the first frame,
updates of the unfiltered image per second, and the longest wait for one. Then measures, in a preview, the seconds from
a camera turn to the first image of the new view, at times spread over the render and its filter passes. Needs the
standard library only.
"""

import argparse
import base64
import json
import os
import socket
import statistics
import struct
import subprocess
import tempfile
import time
import urllib.parse

# Offset of the view in a frame's header, and its value for the unfiltered image, which changes with every batch.
VIEW_BYTE, RAW = 1, 1
HEADER = 28


def frame_length(piece):
    """Returns the bytes of the frame that begins with this piece."""
    channels, width, height, grid = struct.unpack("<2xBxHH16xB", piece[:25])
    columns, rows = -(-width // grid), -(-height // grid)
    return HEADER + 2 * channels * columns * rows


class Socket:
    """The part of a WebSocket (RFC 6455) that a viewer needs."""

    def __init__(self, address):
        url = urllib.parse.urlsplit(address)
        self.stream = socket.create_connection((url.hostname, url.port))
        target = "/live" + ("?" + url.query if url.query else "")
        key = base64.b64encode(os.urandom(16)).decode()
        lines = [
            f"GET {target} HTTP/1.1", f"Host: {url.netloc}", f"Origin: {url.scheme}://{url.netloc}",
            "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13", f"Sec-WebSocket-Key: {key}",
        ]
        self.stream.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        self.file = self.stream.makefile("rb")
        status = self.file.readline().decode().strip()
        if " 101 " not in status:
            raise RuntimeError(f"{url.netloc}: the server answered {status}; expected status 101")
        while self.file.readline() not in (b"\r\n", b""):
            pass

    def send(self, content):
        data, mask = json.dumps(content).encode(), os.urandom(4)
        length = bytes([0x80 | len(data)]) if len(data) < 126 else bytes([0x80 | 126]) + struct.pack(">H", len(data))
        self.stream.sendall(b"\x81" + length + mask + bytes(b ^ mask[i % 4] for i, b in enumerate(data)))

    def receive(self):
        """Returns the kind (1 text, 2 frame) and the bytes of a text or a whole frame, or None when the connection closes."""
        message = self.receive_message()
        while message is not None and message[0] == 2 and len(message[1]) < frame_length(message[1]):
            piece = self.receive_message()
            message = piece and (2, message[1] + piece[1])
        return message

    def receive_message(self):
        """Returns a message's kind (1 text, 2 binary) and bytes, or None when the connection closes."""
        kind, data = 0, b""
        while True:
            head = self.file.read(2)
            if len(head) < 2 or head[0] & 15 == 8:
                return None
            length = head[1] & 127
            if length == 126:
                length = struct.unpack(">H", self.file.read(2))[0]
            elif length == 127:
                length = struct.unpack(">Q", self.file.read(8))[0]
            data += self.file.read(length)
            kind = kind or head[0] & 15
            if head[0] & 128:
                return kind, data


def resolution(arguments):
    """Returns the arguments that set the resolution."""
    return ["--resolution", arguments.resolution] if arguments.resolution else []


def render(arguments, folder, has_viewer):
    """Returns the number of samples of a render, and the times of its frames since the address was printed."""
    report = os.path.join(folder, "report.json")
    command = [arguments.prpf, "render", arguments.scene, "--time", f"{arguments.time}s", "--report", report]
    command += ["-o", os.path.join(folder, "image.png")] + resolution(arguments) + (["--preview"] if has_viewer else [])
    program = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    frames = []
    if has_viewer:
        address = next(line for line in program.stdout if line.startswith("preview at ")).split()[2]
        start, viewer = time.monotonic(), Socket(address)
        viewer.send({"type": "views", "views": arguments.views.split(",")})
        viewer.send({"type": "ready"})
        try:
            while (message := viewer.receive()) is not None:
                if message[0] == 2:
                    if message[1][VIEW_BYTE] == RAW:
                        frames.append(time.monotonic() - start)
                    viewer.send({"type": "ready"})
        except OSError:
            pass  # The render is over.
    program.stdout.read()
    if program.wait() != 0:
        raise RuntimeError(f"{' '.join(command)}: exit status {program.returncode}")
    with open(report) as file:
        return json.load(file)["samples_total"], frames


def turn_latencies(arguments, count=20):
    """Returns the seconds from each of some camera turns to the first image of the new view."""
    command = [arguments.prpf, "preview", arguments.scene, "--quality", arguments.quality, "--quiet"]
    command += resolution(arguments)
    program = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        address = next(line for line in program.stdout if line.startswith("preview at ")).split()[2]
        viewer, generation, latencies = Socket(address), 0, []
        viewer.send({"type": "views", "views": ["raw", "filtered"]})
        viewer.send({"type": "ready"})

        def receive(until):
            """Receives frames until a time or a new generation; returns the newest generation."""
            newest = generation
            while time.monotonic() < until and newest == generation:
                kind, data = viewer.receive()
                if kind == 2:
                    newest = max(newest, *struct.unpack("<I", data[8:12]))
                    viewer.send({"type": "ready"})
            return newest

        generation = receive(time.monotonic() + 60)
        for turn in range(count):
            receive(time.monotonic() + 0.3 + 3 * (turn * 0.618 % 1))
            start = time.monotonic()
            viewer.send({"type": "camera", "orbit": [0.05, 0.0]})
            generation = receive(start + 60)
            latencies.append(time.monotonic() - start)
        return latencies
    finally:
        program.kill()
        program.wait()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("prpf")
    parser.add_argument("scene")
    parser.add_argument("--time", type=int, default=15)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--views", default="raw,filtered")
    parser.add_argument("--quality", default="standard", help="preset of the denoiser while the camera turns")
    parser.add_argument("--resolution", metavar="WxH", help="in place of the scene's own")
    arguments = parser.parse_args()
    ratios, firsts, rates, waits = [], [], [], []
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(arguments.runs):
            without, _ = render(arguments, folder, False)
            with_viewer, frames = render(arguments, folder, True)
            ratios.append(with_viewer / without)
            firsts.append(frames[0])
            rates.append((len(frames) - 1) / (frames[-1] - frames[0]))
            waits.append(max(b - a for a, b in zip(frames, frames[1:])))
    median = statistics.median
    print(f"ratio of samples with and without a viewer: {median(ratios):.3f} ({min(ratios):.3f} to {max(ratios):.3f})")
    print(f"first frame after {median(firsts):.3f} s, {median(rates):.1f} updates per second, "
          f"longest wait {median(waits):.2f} s")
    latencies = turn_latencies(arguments)
    print(f"first image after a camera turn: {median(latencies):.3f} s, at most {max(latencies):.3f} s "
          f"({len(latencies)} turns)")


if __name__ == "__main__":
    main()
