"""Half an hour of a lighting artist's work in the live page, in headless Chromium: measures every wait.

    pip install websocket-client
    python3 experiments/preview/artist_session.py PRPF SCENE FOLDER [--resolution 1920x1080] [--pace 1] [--steps STEP,...]

Opens a preview of the scene and does what an artist does: moves the camera, focuses, renders a region first, looks at
views, saves, compares, tries denoisers, restarts, returns, sets budgets, opens other scenes of the folder. After each
step it looks at the image for some seconds (`--pace 0.2` for a fifth of that). A wait ends when the page has drawn what
was asked for. Prints all of them, and those over half a second again at the end. Images, screenshots and the log of
the program go to FOLDER.
"""

import argparse
import base64
import json
import os
import re
import subprocess
import tempfile
import threading
import time

import websocket

LONG = 0.5  # seconds, from which a wait is listed at the end
SHIFT = 8  # among DevTools' modifiers
CODES = {"Enter": 13, "Escape": 27, "Home": 36, "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40}

# Records every frame that the page gets, with the time at which it was drawn, and every notice.
HOOK = """
window.log = []; window.told = [];
const viewport = window.prpf.viewport, set = viewport.setFrame.bind(viewport), draw = viewport.draw.bind(viewport);
const record = (view, { side, generation, spp }) =>
  window.log.push({ got: performance.now(), view, side, generation, spp, drawn: null });
viewport.frames.forEach((frame, view) => record(view, frame));
viewport.setFrame = (view, frame) => { set(view, frame); record(view, frame); };
viewport.draw = () => {
  draw();
  const isShown = ({ view }) => Object.values(viewport.shown).includes(view);
  for (const entry of window.log.filter(isShown)) entry.drawn ??= performance.now();
};
new MutationObserver((changes) => changes.forEach((change) => change.addedNodes.forEach((node) => window.told.push(node.textContent))))
  .observe(document.getElementById("notices"), { childList: true });
"""


class Browser:
    """A page in headless Chromium, steered by its DevTools protocol."""

    def __init__(self, address, size, profile):
        arguments = ["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--remote-debugging-port=0", "--no-first-run"]
        arguments += ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars"]
        arguments += [f"--user-data-dir={profile}", "about:blank"]
        self.program = subprocess.Popen(["chromium", *arguments], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        devtools = next(filter(None, (re.search(r"DevTools listening on (\S+)", line) for line in self.program.stderr)))
        threading.Thread(target=self.program.stderr.read, daemon=True).start()
        self.socket = websocket.create_connection(devtools[1], suppress_origin=True, timeout=200)
        self.calls, self.session = 0, None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self.call("Emulation.setDeviceMetricsOverride", width=size[0], height=size[1], deviceScaleFactor=1, mobile=False)
        self.call("Page.navigate", url=address)

    def call(self, method, **parameters):
        self.calls += 1
        message = {"id": self.calls, "method": method, "params": parameters}
        self.socket.send(json.dumps(message | ({"sessionId": self.session} if self.session else {})))
        while (answer := json.loads(self.socket.recv())).get("id") != self.calls:
            pass
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']}")
        return answer["result"]

    def value(self, expression):
        """Returns the value of an expression in the page."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(f"{expression}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def wait(self, condition, seconds=60):
        """Waits in the page until a condition holds; returns whether it does."""
        loop = f"""new Promise((done) => {{
            const end = performance.now() + {1000 * seconds};
            const look = () => {{
                let holds = false;
                try {{ holds = Boolean({condition}); }} catch {{}}
                if (holds || performance.now() > end) done(holds); else setTimeout(look, 5);
            }};
            look();
        }})"""
        return self.value(loop)

    def now(self):
        return self.value("performance.now()")

    def mouse(self, kind, at, pressed=False, down=0):
        extra = {"deltaX": 0, "deltaY": down} if kind == "mouseWheel" else {"button": "left" if pressed or kind != "mouseMoved" else "none"}
        self.call("Input.dispatchMouseEvent", type=kind, x=at[0], y=at[1], buttons=int(pressed), clickCount=1, **extra)

    def click_at(self, at):
        self.mouse("mousePressed", at, pressed=True)
        self.mouse("mouseReleased", at)

    def click(self, selector):
        found = f"document.querySelector({json.dumps(selector)})"
        self.value(f"{found}.scrollIntoView({{ block: 'center' }})")
        self.click_at(self.value(f"(() => {{ const b = {found}.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; }})()"))

    def key(self, key, modifiers=0):
        text = "\r" if key == "Enter" else key if len(key) == 1 else ""
        for kind in ("keyDown", "keyUp"):
            pressed = {"text": text} if kind == "keyDown" else {}
            self.call("Input.dispatchKeyEvent", type=kind, key=key, modifiers=modifiers, windowsVirtualKeyCode=CODES.get(key, 0), **pressed)

    def enter(self, field, text):
        """Enters text in a field of the page."""
        self.value(f"(() => {{ const f = document.getElementById('{field}'); f.focus(); f.value = '{text}'; f.dispatchEvent(new Event('change')); f.blur(); }})()")

    def screenshot(self, path):
        with open(path, "wb") as file:
            file.write(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))


class Artist:
    """The page, and what an artist waits for."""

    def __init__(self, browser, folder, pace):
        self.browser, self.folder, self.pace = browser, folder, pace
        self.waits = []

    def look(self, seconds):
        time.sleep(seconds * self.pace)

    def screenshot(self, name):
        self.browser.screenshot(os.path.join(self.folder, f"{name}.png"))

    def record(self, what, seconds, detail=""):
        self.waits.append((what, seconds))
        print(f"{what}: {'NOT IN TIME' if seconds is None else f'{seconds:.2f} s'}{detail}", flush=True)

    def state(self):
        """Returns a line on the state of the render, as the page shows it."""
        shown = """(() => {
            const text = (selector) => document.querySelector(selector).textContent;
            return ["#phase", ...["mean", "rate", "error", "made_by", "memory"].map((name) => `[data-value=${name}]`), "#forecast"].map(text).join(" | ");
        })()"""
        return self.browser.value(shown) + f" | bar {self.browser.value('window.prpf.state.status.statistics.fraction'):.2f}"

    def generation(self):
        return self.browser.value("Math.max(window.prpf.state.status.generation, ...[...window.prpf.viewport.frames.values()].map((f) => f.generation))")

    def frame(self, what, since, condition, seconds=60):
        """Waits for a drawn frame `e` since a time of the page that meets a condition."""
        found = f"window.log.find((e) => e.got >= {since} && e.drawn !== null && ({condition}))"
        if not self.browser.wait(found, seconds):
            return self.record(what, None)
        entry = self.browser.value(found)
        self.record(what, (entry["drawn"] - since) / 1000, f" (squares of {entry['side']}, {entry['spp']:.3g} samples per pixel)")

    def until(self, what, since, condition, seconds=60):
        """Waits for a condition in the page since a time of it."""
        holds = self.browser.wait(condition, seconds)
        self.record(what, (self.browser.now() - since) / 1000 if holds else None)

    def moved(self, what, act, is_full=True):
        """Acts, and waits for the images of another view: the first one, the first filtered one, and one of full size."""
        before, since = self.generation(), self.browser.now()
        act()
        self.frame(f"{what}, first image", since, f"e.generation > {before}")
        self.frame(f"{what}, filtered", since, f"e.generation > {before} && e.view === 'filtered'")
        if is_full:
            self.frame(f"{what}, filtered at full size", since, f"e.generation > {before} && e.view === 'filtered' && e.side <= 1", 120)

    def at(self, x, y):
        """Returns where a point of the image, in fractions of its size, is in the page."""
        return self.browser.value(f"""(() => {{
            const v = window.prpf.viewport, b = v.canvas.getBoundingClientRect(), p = v.toCanvas(v.size[0] * {x}, v.size[1] * {y});
            return [b.x + p[0], b.y + p[1]];
        }})()""")

    def focus_image(self):
        self.browser.value("document.getElementById('viewport').focus()")

    def press(self, key, modifiers=0):
        """Presses a key, and agrees to what the page asks."""
        self.browser.key(key, modifiers)
        self.agree()

    def agree(self):
        if self.browser.wait("document.getElementById('question').open", 0.2):
            print("asked:", self.browser.value("document.getElementById('question-text').textContent"))
            self.browser.click("#question button[value=yes]")

    def show(self, view):
        self.browser.click(f"input[name=view][value={view}]")


def opening(artist):
    artist.frame("opening, filtered", 0, "e.view === 'filtered'")
    artist.frame("opening, filtered at full size", 0, "e.view === 'filtered' && e.side <= 1", 120)
    artist.look(20)
    print(artist.state())
    artist.screenshot("opening")


def arrows(artist):
    artist.browser.key("c")
    artist.focus_image()
    for key in ("ArrowLeft", "ArrowUp", "ArrowRight", "ArrowDown"):
        artist.moved(f"turn by {key}", lambda: artist.browser.key(key))
        artist.look(10)


def orbit(artist):
    """Drags the camera to and fro, so that it stays in the room."""
    middle = artist.at(0.5, 0.5)
    for _ in range(3):
        before, since = artist.generation(), artist.browser.now()
        artist.browser.mouse("mouseMoved", middle)
        artist.browser.mouse("mousePressed", middle, pressed=True)
        for step in [*range(20), *reversed(range(4, 20))]:
            artist.browser.mouse("mouseMoved", [middle[0] + 2 * step, middle[1]], pressed=True)
            time.sleep(0.05)
        artist.browser.mouse("mouseReleased", [middle[0] + 8, middle[1]])
        end = artist.browser.now()
        times = artist.browser.value(f"window.log.filter((e) => e.generation > {before} && e.drawn > {since} && e.drawn < {end}).map((e) => e.drawn)")
        gaps = [b - a for a, b in zip([since, *times], [*times, end])]
        print(f"drag: {len(times)} images in {(end - since) / 1000:.1f} s, longest gap {max(gaps) / 1000:.2f} s")
        artist.frame("end of a drag, next image", end, "true")
        artist.frame("end of a drag, filtered", end, "e.view === 'filtered'")
        artist.frame("end of a drag, filtered at full size", end, "e.view === 'filtered' && e.side <= 1", 120)
        artist.look(10)
    artist.screenshot("orbit")


def dolly(artist):
    for down in (-120, 120):
        artist.moved("dolly", lambda: artist.browser.mouse("mouseWheel", artist.at(0.5, 0.5), down=down))
        artist.look(8)


def undo(artist):
    artist.moved("undo", lambda: artist.press("u"))
    artist.look(5)
    artist.moved("redo", lambda: artist.press("U", SHIFT))
    artist.look(5)
    artist.moved("camera reset", lambda: artist.press("Home"))
    artist.look(10)


def focus(artist):
    artist.moved("aperture", lambda: artist.browser.enter("aperture", "0.05"), is_full=False)
    artist.browser.key("f")
    for point in ((0.5, 0.6), (0.3, 0.5)):
        artist.moved("focus", lambda: artist.browser.click_at(artist.at(*point)))
        artist.look(10)
    artist.screenshot("focus")


def region(artist):
    artist.browser.key("r")
    corner, opposite, since = artist.at(0.4, 0.4), artist.at(0.6, 0.65), artist.browser.now()
    artist.browser.mouse("mouseMoved", corner)
    artist.browser.mouse("mousePressed", corner, pressed=True)
    artist.browser.mouse("mouseMoved", opposite, pressed=True)
    artist.browser.mouse("mouseReleased", opposite)
    artist.frame("region, next filtered image", since, "e.view === 'filtered'")
    artist.look(30)
    print(artist.state())
    artist.screenshot("region")
    since = artist.browser.now()
    artist.browser.key("Escape")
    artist.frame("region cleared, next filtered image", since, "e.view === 'filtered'", 120)
    artist.look(10)


def views(artist):
    for view in ("raw", "samples", "error", "variance", "residual", "failure", "albedo", "normal", "filtered"):
        since = artist.browser.now()
        artist.show(view)
        artist.until(f"view {view}", since, f"window.log.some((e) => e.view === '{view}' && e.drawn !== null && e.generation === {artist.generation()})")
        artist.look(6)
        if view in ("error", "samples"):
            artist.screenshot(f"view-{view}")
    for view in ("error", "failure"):
        artist.show(view)
        artist.browser.key("c")
        artist.focus_image()
        before, since = artist.generation(), artist.browser.now()
        artist.browser.key("ArrowLeft")
        artist.frame(f"turn in the view {view}, first image", since, f"e.generation > {before}")
        artist.frame(f"turn in the view {view}, its map", since, f"e.generation > {before} && e.view === '{view}'", 120)
        artist.look(8)
    artist.show("filtered")
    artist.press("Home")
    artist.look(5)


def saves(artist):
    artist.browser.key("c")
    artist.focus_image()
    for delay in (0.3, 3, 15):
        before = artist.generation()
        artist.browser.key("ArrowRight")
        artist.browser.wait(f"window.prpf.state.status.generation > {before}")
        time.sleep(delay)
        since, told = artist.browser.now(), artist.browser.value("window.told.length")
        artist.browser.key("s")
        artist.until(f"save {delay} s after a move", since, f"window.told.slice({told}).some((text) => /^(not )?saved/.test(text))", 120)
        artist.look(10)


def compare(artist):
    saved = artist.browser.value("[...document.getElementById('against').options].map((o) => o.value).filter((v) => v.startsWith('save:'))")
    artist.browser.value(f"(() => {{ const s = document.getElementById('against'); s.value = '{saved[-1]}'; s.dispatchEvent(new Event('change')); }})()")
    since = artist.browser.now()
    artist.browser.key("w")
    artist.until("wipe with a saved image", since, f"window.prpf.viewport.shown.left === '{saved[-1]}' && window.prpf.viewport.frames.has('{saved[-1]}')")
    artist.look(15)
    artist.screenshot("wipe")
    artist.browser.key("w")
    artist.browser.key("x")
    artist.look(10)
    artist.browser.key("x")


def denoisers(artist):
    for name in ("nlm", "prpf", "none", "learned"):
        since = artist.browser.now()
        artist.browser.click(f"input[name=denoiser][value={name}]")
        artist.agree()
        if name != "none":
            artist.until(f"first image by {name}", since, f"document.querySelector('[data-value=made_by]').textContent.startsWith('{name}')", 150)
        artist.look(12)
        print(artist.state())


def restart(artist):
    artist.moved("restart", lambda: artist.press("R", SHIFT))
    artist.look(10)
    artist.moved("undo of the restart", lambda: artist.press("u"), is_full=False)
    artist.look(5)


def bookmark(artist):
    artist.browser.key("c")
    artist.focus_image()
    artist.browser.key("b")
    artist.browser.wait("document.querySelector('#bookmarks li')")
    artist.moved("pan", lambda: artist.browser.key("ArrowLeft", SHIFT), is_full=False)
    artist.look(8)
    artist.moved("return to a bookmark", lambda: artist.browser.click("#bookmarks li button"), is_full=False)
    artist.look(8)


def budgets(artist):
    """Sets budgets of time and of error, and prints what the page says on the way."""
    elapsed = artist.browser.value("window.prpf.state.status.statistics.seconds")
    for field, text, seconds in (("seconds", f"{elapsed + 90:.0f}", 130), ("target_error", "0.005", 240)):
        artist.browser.enter(field, text)
        started = time.monotonic()
        while time.monotonic() - started < seconds and not artist.browser.wait("window.prpf.state.status.stopped_by", 10):
            print(f"{time.monotonic() - started:.0f} s after {field} = {text}:", artist.state())
        print(f"end of {field}:", artist.state())
        artist.screenshot(f"budget-{field}")
        artist.browser.enter(field, "0")
        artist.look(3)


def scenes(artist):
    """Opens another scene of the folder, and comes back."""
    listed = "[...document.querySelectorAll('#scene-list button')]"
    own = artist.browser.value("window.prpf.state.status.scene")

    def show_list():
        artist.focus_image()
        artist.browser.key("o")
        artist.browser.wait(f"{listed}.length > 0")

    show_list()
    others = [path for path in artist.browser.value(f"{listed}.map((b) => b.title)") if path != own]
    artist.browser.key("Escape")
    if not others:
        return print("there is no other scene in this folder")
    for path in (others[0], own):
        show_list()
        since, name = artist.browser.now(), os.path.basename(path)
        artist.browser.value(f"{listed}.find((b) => b.title === {json.dumps(path)}).click()")
        artist.frame(f"open {name}, first image", since, "true", 120)
        artist.frame(f"open {name}, filtered", since, "e.view === 'filtered'", 120)
        artist.look(20)
        print(artist.state())
        artist.screenshot(f"scene-{name}")


STEPS = [opening, arrows, orbit, dolly, undo, focus, region, views, saves, compare, denoisers, restart, bookmark, budgets, scenes]


def resident(program):
    """Returns the memory that a process holds, in MiB."""
    with open(f"/proc/{program.pid}/status") as file:
        return int(re.search(r"VmRSS:\s+(\d+)", file.read())[1]) // 1024


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("prpf")
    parser.add_argument("scene")
    parser.add_argument("folder")
    parser.add_argument("--resolution", default="1920x1080", metavar="WxH", help="of the image and of the window")
    parser.add_argument("--pace", type=float, default=1.0, help="factor on the time for looking")
    parser.add_argument("--steps", default=",".join(step.__name__ for step in STEPS))
    arguments = parser.parse_args()
    os.makedirs(arguments.folder, exist_ok=True)
    command = [arguments.prpf, "preview", arguments.scene, "-o", os.path.join(arguments.folder, "image.exr"), "--resolution", arguments.resolution]
    with open(os.path.join(arguments.folder, "prpf.log"), "w") as log, tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        program = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True)
        browser = None
        try:
            address = next(line for line in program.stdout if line.startswith("preview at ")).split()[2]
            browser = Browser(address, [int(n) for n in arguments.resolution.split("x")], profile)
            browser.wait("window.prpf?.viewport.frames.size > 0")
            artist = Artist(browser, arguments.folder, arguments.pace)
            artist.record("opening, first image", browser.now() / 1000)
            browser.value(f"(() => {{ {HOOK} }})()")
            work(artist, arguments.steps.split(","), program)
        finally:
            if browser:
                browser.program.kill()
                browser.program.wait()
            program.terminate()
            program.wait()


def work(artist, names, program):
    """Performs the steps of these names, and prints the long waits."""
    started = time.monotonic()
    for step in STEPS:
        if step.__name__ in names:
            print(f"--- {step.__name__}, after {time.monotonic() - started:.0f} s, {resident(program)} MiB", flush=True)
            step(artist)
    print(f"--- end, after {time.monotonic() - started:.0f} s, {resident(program)} MiB")
    print("notices:", *artist.browser.value("window.told"), sep="\n  ")
    print("waits over half a second:")
    for what, seconds in artist.waits:
        if seconds is None or seconds > LONG:
            print(f"  {what}: {'not in time' if seconds is None else f'{seconds:.2f} s'}")


if __name__ == "__main__":
    main()
