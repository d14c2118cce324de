// A sheet over the image that a button opens and closes: help, list of scenes, lines of the camera.

export class Sheet {
  // The focus goes back to where it was when the sheet closes.
  constructor(sheet, button) {
    Object.assign(this, { sheet, button, before: null });
  }

  isOpen() {
    return !this.sheet.hidden;
  }

  // Opens or closes the sheet; returns whether it is open.
  toggle() {
    const holdsFocus = this.sheet.contains(document.activeElement);
    this.sheet.hidden = this.isOpen();
    this.button.setAttribute("aria-expanded", String(this.isOpen()));
    if (this.isOpen()) this.before = document.activeElement;
    else if (holdsFocus) this.before.focus();
    return this.isOpen();
  }
}
