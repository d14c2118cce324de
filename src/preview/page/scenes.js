// The list of scenes that can be opened in place of the current one.

import { Sheet } from "./sheet.js";

const $ = (id) => document.getElementById(id);

export class Scenes {
  // `open(index)` opens a scene; `notify(text, isProblem)` tells the user something.
  constructor(open, notify) {
    Object.assign(this, { open, notify });
    this.sheet = new Sheet($("scenes"), $("show-scenes"));
    $("show-scenes").onclick = () => this.toggle();
  }

  async toggle() {
    if (!this.sheet.toggle()) return;
    const answer = await fetch(`/scenes${location.search}`).catch(() => null);
    if (answer?.ok) return this.list(await answer.json());
    this.notify("cannot list the scenes: no answer from prpf", true);
    if (this.sheet.isOpen()) this.sheet.toggle();
  }

  // Builds a button for each scene; the part of the path that all have in common is left out.
  list(paths) {
    $("no-scenes").hidden = paths.length > 1;
    const folders = paths.map((path) => path.split("/").slice(0, -1));
    const common = (folders[0] ?? []).findIndex((part, i) => folders.some((folder) => folder[i] !== part));
    const shared = common < 0 ? folders[0]?.length ?? 0 : common;
    $("scene-list").replaceChildren(...paths.map((path, index) => {
      const name = path.split("/").slice(shared).join("/");
      const button = Object.assign(document.createElement("button"), { textContent: name, title: path });
      button.setAttribute("aria-pressed", String(path === this.current));
      button.onclick = () => { this.toggle(); if (path !== this.current) this.open(index); };
      const item = document.createElement("li");
      item.append(button);
      return item;
    }));
    const buttons = [...$("scene-list").querySelectorAll("button")];
    (buttons.find((button) => button.title === this.current) ?? buttons[0])?.focus();
  }

  show({ scene }) {
    this.current = scene;
  }
}
