// The WebSocket to the render: frames, status and answers in, messages out. Reconnects when it breaks, and finds out why.

import { FramePieces, decodeFrame } from "./frame.js";

const RETRY_MILLISECONDS = 1000;
// The render gives a sign of life every two seconds.
const LONGEST_SILENCE = 8000; // milliseconds
const ANSWER_MILLISECONDS = 3000; // that the reason of a lost connection may take to arrive
// Between two of the page's own, while a frame arrives.
const ALIVE_MILLISECONDS = 1000;
// Messages that are no commands: nothing answers them.
const NO_COMMANDS = ["views", "ready", "alive"];
const REASONS = {
  204: "connection lost, reconnecting",
  403: "this address is no longer valid: open the one that prpf has printed last",
  503: "prpf already serves the most viewers that it can: waiting for a place",
};

export class Connection {
  // `on`: callbacks { open, unanswered(types), lost(reason), frame, status, loading, values, refused(message, type) }.
  constructor(on) {
    this.on = on;
    this.connect();
    setInterval(() => this.checkSilence(), 1000);
    // A hidden page asks for no frames, so that none are encoded for it.
    document.addEventListener("visibilitychange", () => this.isReadyPending && this.ready());
  }

  connect() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/live${location.search}`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => { this.ended = null; this.on.open(); this.ready(); };
    socket.onmessage = ({ data }) => {
      this.heard = performance.now();
      if (typeof data === "string") this.receiveMessage(JSON.parse(data));
      else this.receivePiece(data);
    };
    socket.onclose = () => this.lose();
    this.socket = socket;
    this.heard = this.sent = performance.now();
    this.pieces = new FramePieces();
    this.unanswered = []; // types of the commands without an answer so far
  }

  // Finds out why there is no connection, and tries again.
  async lose() {
    setTimeout(() => this.connect(), RETRY_MILLISECONDS);
    if (this.unanswered.length > 0) this.on.unanswered(this.unanswered);
    if (this.ended) return this.on.lost(this.ended);
    const request = { cache: "no-store", signal: AbortSignal.timeout(ANSWER_MILLISECONDS) };
    const answer = await fetch(`/admission${location.search}`, request).catch(() => null);
    if (this.isOpen()) return;
    this.on.lost(answer ? REASONS[answer.status] ?? REASONS[204] : "no answer from prpf: it has ended, or the network is down");
  }

  // Gives up a connection that has been silent for too long, be it open or still to be made.
  checkSilence() {
    const isTried = this.socket.readyState === WebSocket.CONNECTING || this.isOpen();
    if (!isTried || document.hidden || performance.now() - this.heard < LONGEST_SILENCE) return;
    this.socket.onopen = this.socket.onmessage = this.socket.onclose = null;
    this.socket.close();
    this.lose();
  }

  isOpen() {
    return this.socket.readyState === WebSocket.OPEN;
  }

  // Sends a message; returns false if there is no connection.
  send(type, content = {}) {
    if (!this.isOpen()) return false;
    this.sent = performance.now();
    if (!NO_COMMANDS.includes(type)) this.unanswered.push(type);
    this.socket.send(JSON.stringify({ type, ...content }));
    return true;
  }

  // Asks for the next frame, now or when the page becomes visible.
  ready() {
    this.isReadyPending = document.hidden;
    if (!this.isReadyPending) this.send("ready");
  }

  receiveMessage(message) {
    if (message.type === "ended") this.ended = message.reason;
    // Each command is queued or refused, in their order
    const command = ["queued", "refused"].includes(message.type) ? this.unanswered.shift() : null;
    this.on[message.type]?.(message, command);
  }

  receivePiece(piece) {
    const data = this.pieces.add(piece);
    if (!data) {
      // On a slow link the render's ping waits behind the other pieces.
      if (performance.now() - this.sent > ALIVE_MILLISECONDS) this.send("alive");
      return;
    }
    const frame = decodeFrame(data);
    if (frame) this.on.frame(frame);
    else this.ready();
  }
}
