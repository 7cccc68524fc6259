// Says how things stand: connecting, lost, ended, or what the robot does.
import { byId, setText } from "./dom";
import type { ConnectionState } from "./connection";
import type { History, Moment } from "./history";

/** After so long without a word from an open connection, it is worth saying. */
const kQuiet_s = 2.5;

type Tone = "idle" | "good" | "busy" | "warn" | "bad";

export interface Standing {
  connection: ConnectionState;
  /** Until the next attempt. */
  retry_s: number;
  /** Since anything came in. */
  quiet_s: number;
  history: History | null;
  moment: Moment | null;
}

export function showStatus(standing: Standing): void {
  const pill = byId("run-status");
  const [text, tone] = describe(standing);
  setText(pill, text);
  pill.dataset["tone"] = tone;
  const retry = byId("retry");
  retry.hidden = standing.connection !== "lost";
  setText(retry, `Try now (${Math.max(0, Math.ceil(standing.retry_s))} s)`);
  showCard(standing);
  showVerdict(standing.moment);
}

function describe({ connection, quiet_s, history, moment }: Standing): [string, Tone] {
  if (history === null) {
    return connection === "lost" ? ["No run answers", "warn"] : ["Connecting", "idle"];
  }
  const end = moment?.end ?? null;
  if (end !== null) return end.success ? ["Ended: succeeded", "good"] : ["Ended: failed", "bad"];
  if (connection === "lost" && history.end === null) return ["Connection lost", "bad"];
  if (connection === "connecting") return ["Connecting again", "warn"];
  if (connection === "open" && quiet_s > kQuiet_s && history.end === null) {
    return [`Quiet for ${Math.floor(quiet_s)} s`, "warn"];
  }
  const status = moment?.state?.status ?? "";
  const tones: Record<string, Tone> = { moving: "busy", waiting: "warn", reached: "good" };
  return [status === "" ? "Nothing told yet" : capital(status), tones[status] ?? "idle"];
}

function showCard({ connection, history }: Standing): void {
  const card = byId("card");
  if (card.dataset["fixed"] !== undefined) return;
  card.hidden = history !== null;
  setText(byId("card-title"), connection === "lost" ? "No run answers" : "Connecting");
  setText(
    byId("card-text"),
    connection === "lost"
      ? `Nothing listens at ${window.location.host}. Start a run with “sidestep run CONFIG --view”, or play a ` +
          "recording with “sidestep view FILE”; this page then goes on by itself."
      : `Waiting for the run at ${window.location.host}.`,
  );
}

function showVerdict(moment: Moment | null): void {
  const note = byId("scene-note");
  const end = moment?.end ?? null;
  if (note.dataset["fault"] !== undefined) return;
  note.hidden = end === null;
  if (end === null) return;
  note.dataset["tone"] = end.success ? "good" : "bad";
  setText(note, end.verdict);
}

/** Something this page could not read or do; stays until it is told otherwise. */
export function showFault(text: string): void {
  const note = byId("scene-note");
  note.hidden = false;
  note.dataset["fault"] = "";
  note.dataset["tone"] = "bad";
  setText(note, text);
}

/** In place of the scene, for good. */
export function showNoScene(reason: string): void {
  const card = byId("card");
  card.dataset["fixed"] = "";
  card.hidden = false;
  setText(byId("card-title"), "This browser does not draw in three dimensions");
  setText(byId("card-text"), `${reason} Times, figures, events and the depth image work without it.`);
}

function capital(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1);
}
