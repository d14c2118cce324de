// The camera's controls: lens, lines of a scene file, bookmarks.

import { fillField, numberField } from "./number_field.js";
import { Sheet } from "./sheet.js";

const $ = (id) => document.getElementById(id);
const PINHOLE_FOCUS = 1e6; // focal distance of a camera that has none

export class CameraPanel {
  // `send(type, content)` sends a message; `notify(text, isProblem)` tells the user something.
  constructor(send, notify) {
    Object.assign(this, { send, notify, list: "", lines: new Sheet($("lines"), $("show-lines")) });
    for (const [id, name] of [["aperture", "Aperture"], ["focus", "Focus"]]) {
      numberField($(id), $("camera-explanation"), { name, change: (value) => send("camera", { [id]: value }) });
    }
    $("reset-camera").onclick = () => this.reset();
    $("add-bookmark").onclick = () => this.addBookmark();
    $("show-lines").onclick = () => this.toggleLines();
    $("copy-lines").onclick = () => this.copyLines();
  }

  reset() { this.send("camera", { reset: true }); }

  addBookmark() { this.send("add-bookmark"); }

  toggleLines() {
    if (this.lines.toggle()) $("lines").querySelector("pre").focus();
  }

  // Copies the lines; where the browser does not allow that, selects them.
  async copyLines() {
    const lines = $("lines").querySelector("pre");
    try {
      await navigator.clipboard.writeText(lines.textContent);
      this.notify("lines copied", false);
    } catch {
      getSelection().selectAllChildren(lines);
      this.notify("lines selected: copy them with Ctrl+C", false);
    }
  }

  show({ camera, bookmarks }) {
    fillField($("aperture"), camera.aperture);
    fillField($("focus"), camera.aperture === 0 && camera.focus >= PINHOLE_FOCUS ? null : camera.focus);
    const lines = $("lines").querySelector("pre");
    if (lines.textContent !== camera.directives) lines.textContent = camera.directives;
    this.showBookmarks(bookmarks, camera.directives);
  }

  // Builds two buttons for each bookmark: go there, and remove it.
  showBookmarks(bookmarks, current) {
    const list = JSON.stringify(bookmarks);
    if (list !== this.list) {
      this.list = list;
      $("bookmarks").replaceChildren(...bookmarks.map(({ number, directives }, index) => {
        const item = document.createElement("li");
        const go = Object.assign(document.createElement("button"), { textContent: String(index + 1), title: directives });
        go.setAttribute("aria-label", `Bookmark ${index + 1}`);
        go.onclick = () => this.send("camera", { bookmark: number });
        const remove = Object.assign(document.createElement("button"), { textContent: "×", title: "Remove" });
        remove.setAttribute("aria-label", `Remove bookmark ${index + 1}`);
        remove.onclick = () => this.send("remove-bookmark", { number });
        item.append(go, remove);
        return item;
      }));
    }
    [...$("bookmarks").children].forEach((item, index) => {
      item.firstChild.setAttribute("aria-pressed", String(bookmarks[index].directives === current));
    });
  }
}
