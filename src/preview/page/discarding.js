// Asks before a command discards a render that cannot be kept.

// Renders that took less are not worth a question.
const WORTH_SECONDS = 10;

// Returns whether a message discards the samples so far.
function discards(type, content, status) {
  if (type === "restart" || type === "camera") return true;
  if (type !== "settings") return false;
  const { settings, denoisers, most_spp_kept } = status;
  if (content.denoiser || content.quality) {
    const method = content.denoiser ?? settings.denoiser;
    const isChosen = ({ denoiser, quality }) => denoiser === method && (!content.quality || quality === content.quality);
    return denoisers.find(isChosen)?.begins_anew ?? false;
  }
  const spp = content.spp ?? settings.budget.spp;
  const most = most_spp_kept[content.sampling ?? settings.sampling];
  return most !== null && !(spp > 0 && spp <= most);
}

export class Discarding {
  // `current()` returns the newest status, or null; `notify(text, isProblem)` tells the user something.
  constructor(dialog, current, notify) {
    Object.assign(this, { dialog, current, notify });
    this.allowed = null; // generation for which the user has agreed
  }

  // Forgets the question, and what the user has agreed to: the generations of another program have the same numbers.
  forget() {
    this.allowed = null;
    if (this.dialog.open) this.dialog.close("no");
  }

  // Calls `act` at once, or once the user has agreed to what it costs; `refuse` otherwise.
  ask(type, content, act, refuse) {
    const status = this.current();
    const isWorthIt = status && (status.phase === "finished" || status.statistics.seconds > WORTH_SECONDS);
    const isSafe = !isWorthIt || status.history.has_room || this.allowed === status.generation;
    if (isSafe || !discards(type, content, status)) return act();
    if (this.dialog.open) return;
    const { mean } = status.statistics;
    this.dialog.querySelector("p").textContent =
      `There is not enough memory to keep this render of ${mean.toFixed(1)} samples per pixel beside a new one. Discard it?`;
    this.dialog.onclose = () => {
      if (this.dialog.returnValue !== "yes") return refuse();
      if (this.current()?.generation !== status.generation) {
        this.notify("another render has begun meanwhile: the command was not sent", true);
        return refuse();
      }
      this.allowed = status.generation;
      act();
    };
    this.dialog.returnValue = "no";
    this.dialog.showModal();
  }
}
