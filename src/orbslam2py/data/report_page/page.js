// SPDX-License-Identifier: BSD-3-Clause
// The page's only script: dark and light, one cursor over all plots, the path in three dimensions.
"use strict";

const data = JSON.parse(document.getElementById("data").textContent);
const root = document.documentElement;
const find = (selector) => [...document.querySelectorAll(selector)];
const make = (name, look, text) => {
  const made = document.createElement(name);
  made.className = look;
  if (text !== undefined) made.textContent = text;
  return made;
};

// ---- dark and light ------------------------------------------------------------------------
const remembered = {
  // A page that is opened from a disk may have no storage: then nothing is remembered.
  get() { try { return localStorage.getItem("orbslam2py-theme"); } catch { return null; } },
  set(value) { try { localStorage.setItem("orbslam2py-theme", value); } catch { /* as above */ } },
};
const preference = matchMedia("(prefers-color-scheme: dark)");
const isDark = () => (root.dataset.theme ? root.dataset.theme === "dark" : preference.matches);
const button = document.getElementById("theme");
const nameButton = () => { button.textContent = isDark() ? "Light" : "Dark"; };
if (["dark", "light"].includes(remembered.get())) root.dataset.theme = remembered.get();
button.hidden = false;
nameButton();
button.addEventListener("click", () => {
  root.dataset.theme = isDark() ? "light" : "dark";
  remembered.set(root.dataset.theme);
  nameButton();
  solid?.draw();
});
preference.addEventListener("change", () => { nameButton(); solid?.draw(); });

// ---- the path in three dimensions ----------------------------------------------------------
class Solid {
  constructor(canvas) {
    this.canvas = canvas;
    this.layers = { points: true, keyframes: true, truth: true, loops: true };
    this.cursors = [];
    this.points = this.unpackPoints();
    this.paths = data.paths ?? [{ positions: data.positions, colours: data.colour }];
    this.home();
    this.look("near-behind");
    this.listen();
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  unpackPoints() {
    const bytes = Uint8Array.from(atob(data.points || ""), (c) => c.charCodeAt(0));
    const numbers = new Uint16Array(bytes.buffer);
    const [x, y, z, size] = data.box;
    return Float32Array.from(numbers, (n, k) => [x, y, z][k % 3] + (n / 65535) * size);
  }

  // The middle and the size of what there is.
  home() {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (const { positions } of [...this.paths, { positions: data.truth ?? [] }]) {
      positions.forEach((value, k) => {
        if (value === null) return;
        low[k % 3] = Math.min(low[k % 3], value);
        high[k % 3] = Math.max(high[k % 3], value);
      });
    }
    this.middle = low.map((value, k) => (value <= high[k] ? (value + high[k]) / 2 : 0));
    this.extent = Math.max(1e-6, Math.hypot(...low.map((v, k) => (v <= high[k] ? high[k] - v : 0))));
  }

  look(from) {
    const views = { above: [0, Math.PI / 2], side: [Math.PI / 2, 0], behind: [0, 0], "near-behind": [-0.45, 0.55] };
    [this.turn, this.tilt] = views[from];
    this.isFitted = true;
    this.draw();
  }

  // Borders of the path, the truth and the keyframes in the picture, in its pixels.
  reach() {
    const box = [Infinity, Infinity, -Infinity, -Infinity], project = this.projector();
    const add = (x, y, z) => {
      const [u, v] = project(x, y, z);
      [box[0], box[1], box[2], box[3]] = [Math.min(box[0], u), Math.min(box[1], v), Math.max(box[2], u), Math.max(box[3], v)];
    };
    for (const { positions } of [...this.paths, { positions: data.truth ?? [] }]) {
      for (let k = 0; k < positions.length; k += 3) {
        if (positions[k] !== null) add(positions[k], positions[k + 1], positions[k + 2]);
      }
    }
    const poses = data.keyframes ?? [];
    for (let k = 0; k < poses.length; k += 12) add(poses[k + 3], poses[k + 7], poses[k + 11]);
    return box;
  }

  // Let all of it be seen, as large as the window allows; how near changes what perspective does.
  fit(ratio) {
    const { width, height } = this.canvas;
    this.zoom = 1;
    this.shift = [0, 0];
    for (let turn = 0; turn < 12; turn += 1) {
      const [left, top, right, bottom] = this.reach();
      if (!(right >= left)) return;
      const factor = Math.min((0.84 * width) / Math.max(1, right - left), (0.8 * height) / Math.max(1, bottom - top));
      const wanted = Math.min(2.2, Math.max(0.05, this.zoom * factor));
      this.shift = [this.shift[0] + (width - left - right) / 2 / ratio, this.shift[1] + (height - top - bottom) / 2 / ratio];
      if (Math.abs(wanted / this.zoom - 1) < 0.002 && turn > 0) break;
      this.zoom = Math.sqrt(this.zoom * wanted);
    }
    const [left, top, right, bottom] = this.reach();
    this.shift = [this.shift[0] + (width - left - right) / 2 / ratio, this.shift[1] + (height - top - bottom) / 2 / ratio];
  }

  // Rows of the rotation from the first keyframe's axes (right, down, forward) to the screen's.
  axes() {
    const [ct, st, ci, si] = [Math.cos(this.turn), Math.sin(this.turn), Math.cos(this.tilt), Math.sin(this.tilt)];
    return [[ct, 0, -st], [-st * si, ci, -ct * si], [st * ci, si, ct * ci]];
  }

  projector() {
    const { width, height } = this.canvas;
    const [a, b, c] = this.axes(), m = this.middle;
    const scale = (1.0 * Math.min(width, 1.15 * height) / this.extent) * this.zoom;
    const far = 2.5 * this.extent / this.zoom;
    const ratio = devicePixelRatio;
    return (x, y, z) => {
      x -= m[0]; y -= m[1]; z -= m[2];
      const depth = c[0] * x + c[1] * y + c[2] * z;
      const size = (scale * far) / Math.max(0.05 * far, far + depth);
      return [
        width / 2 + this.shift[0] * ratio + size * (a[0] * x + a[1] * y + a[2] * z),
        height / 2 + this.shift[1] * ratio + size * (b[0] * x + b[1] * y + b[2] * z),
      ];
    };
  }

  draw() {
    cancelAnimationFrame(this.waiting);
    this.waiting = requestAnimationFrame(() => this.drawNow());
  }

  drawNow() {
    const ratio = devicePixelRatio, { canvas } = this;
    canvas.width = Math.round(canvas.clientWidth * ratio);
    canvas.height = Math.round(canvas.clientHeight * ratio);
    if (this.isFitted) this.fit(ratio);
    this.project = this.projector();
    const [left, top, right, bottom] = this.reach();
    const { width, height } = canvas;
    canvas.dataset.reach = JSON.stringify([left / width, top / height, right / width, bottom / height]);
    this.pen = canvas.getContext("2d");
    this.pen.lineJoin = this.pen.lineCap = "round";
    this.style = getComputedStyle(root);
    if (this.layers.points) this.drawPoints(ratio);
    if (this.layers.truth && data.truth) this.line(data.truth, "--truth", 5 * ratio);
    for (const path of this.paths) this.drawPath(path, ratio);
    if (this.layers.keyframes) this.drawKeyframes(ratio);
    if (this.layers.loops) this.drawLoops(ratio);
    this.drawAxes(ratio);
    for (const at of this.cursors) this.drawCursor(at, ratio);
    canvas.dataset.drawn = "yes";
  }

  colour(name) { return this.style.getPropertyValue(name).trim(); }

  drawPoints(ratio) {
    const { pen, points } = this, size = 2.2 * ratio;
    pen.fillStyle = this.colour("--points");
    for (let k = 0; k < points.length; k += 3) {
      const [u, v] = this.project(points[k], points[k + 1], points[k + 2]);
      pen.fillRect(u, v, size, size);
    }
  }

  line(positions, colour, width) {
    const { pen } = this;
    pen.strokeStyle = colour.startsWith("--") ? this.colour(colour) : colour;
    pen.lineWidth = width;
    pen.beginPath();
    let down = false;
    for (let k = 0; k < positions.length; k += 3) {
      if (positions[k] === null) { down = false; continue; }
      const [u, v] = this.project(positions[k], positions[k + 1], positions[k + 2]);
      if (down) pen.lineTo(u, v); else pen.moveTo(u, v);
      down = true;
    }
    pen.stroke();
  }

  drawPath({ positions, colours, look }, ratio) {
    const known = colours?.some((colour) => colour >= 0);
    if (!known) { this.line(positions, look ?? "--path", 2.2 * ratio); return; }
    let begin = 0;
    for (let k = 1; k <= colours.length; k += 1) {
      if (k < colours.length && colours[k] === colours[begin]) continue;
      const part = positions.slice(3 * begin, 3 * Math.min(k + 1, colours.length));
      this.line(part, colours[begin] < 0 ? "--soft" : `--e${colours[begin]}`, 2.6 * ratio);
      begin = k;
    }
  }

  drawKeyframes(ratio) {
    const { pen } = this, poses = data.keyframes ?? [], n = poses.length / 12;
    const size = 0.02 * this.extent / Math.sqrt(this.zoom);
    pen.strokeStyle = this.colour("--keyframes");
    pen.lineWidth = 0.8 * ratio;
    pen.globalAlpha = n > 60 ? 0.5 : 0.8;
    pen.beginPath();
    for (let k = 0; k < n; k += 1) {
      const T = poses.slice(12 * k, 12 * k + 12);
      const at = (x, y, z) => this.project(
        T[3] + size * (T[0] * x + T[1] * y + T[2] * z),
        T[7] + size * (T[4] * x + T[5] * y + T[6] * z),
        T[11] + size * (T[8] * x + T[9] * y + T[10] * z));
      const centre = at(0, 0, 0);
      const corners = [at(-1, -0.7, 1.2), at(1, -0.7, 1.2), at(1, 0.7, 1.2), at(-1, 0.7, 1.2)];
      corners.forEach((corner, j) => {
        pen.moveTo(...centre); pen.lineTo(...corner); pen.lineTo(...corners[(j + 1) % 4]);
      });
    }
    pen.stroke();
    pen.globalAlpha = 1;
  }

  drawLoops(ratio) {
    const ends = data.loops ?? [];
    for (let k = 0; k < ends.length; k += 6) {
      this.line(ends.slice(k, k + 6), "--loop", 2.5 * ratio);
      for (const at of [ends.slice(k, k + 3), ends.slice(k + 3, k + 6)]) this.ring(at, "--loop", 6 * ratio, 2 * ratio);
    }
  }

  ring(at, colour, radius, width) {
    const [u, v] = this.project(...at);
    this.pen.strokeStyle = this.colour(colour);
    this.pen.lineWidth = width;
    this.pen.beginPath();
    this.pen.arc(u, v, radius, 0, 7);
    this.pen.stroke();
  }

  drawCursor(at, ratio) {
    this.ring(at, "--ground", 6 * ratio, 5 * ratio);
    this.ring(at, "--text", 6 * ratio, 2.5 * ratio);
  }

  // Where right, up and forward of the first keyframe are, in a corner.
  drawAxes(ratio) {
    const { pen, canvas } = this, [a, b] = this.axes(), length = 34 * ratio;
    const [u, v] = [52 * ratio, canvas.height - 48 * ratio];
    pen.font = `${12 * ratio}px system-ui, sans-serif`;
    pen.fillStyle = pen.strokeStyle = this.colour("--soft");
    pen.lineWidth = 1.5 * ratio;
    for (const [name, k, sign] of [["right", 0, 1], ["up", 1, -1], ["forward", 2, 1]]) {
      const [x, y] = [sign * a[k] * length, sign * b[k] * length];
      if (Math.hypot(x, y) < 0.3 * length) continue;
      pen.beginPath(); pen.moveTo(u, v); pen.lineTo(u + x, v + y); pen.stroke();
      // Beside the end of its line, so that two that point nearly the same way do not overlap.
      pen.textAlign = Math.abs(x) < 0.2 * length ? "center" : x > 0 ? "left" : "right";
      pen.fillText(name, u + 1.2 * x, v + 1.3 * y + 4 * ratio);
    }
  }

  listen() {
    const { canvas } = this, fingers = new Map();
    const factor = () => 0.008;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      canvas.focus({ preventScroll: true });
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    const end = (event) => fingers.delete(event.pointerId);
    canvas.addEventListener("pointerup", end);
    canvas.addEventListener("pointercancel", end);
    canvas.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
      this.isFitted = false;
      if (fingers.size === 2) {
        const [other] = [...fingers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
        const apart = (x, y) => Math.max(10, Math.hypot(x - other[0], y - other[1]));
        this.zoom *= apart(event.clientX, event.clientY) / apart(...before);
        this.shift = [this.shift[0] + dx / 2, this.shift[1] + dy / 2];
      } else if (event.shiftKey) {
        this.shift = [this.shift[0] + dx, this.shift[1] + dy];
      } else {
        this.turn -= factor() * dx;
        this.tilt = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, this.tilt + factor() * dy));
      }
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      this.draw();
    });
    // Only when it was chosen: else it would catch those who scroll the page.
    canvas.addEventListener("wheel", (event) => {
      if (document.activeElement !== canvas) return;
      event.preventDefault();
      this.near(Math.exp(-0.0015 * event.deltaY));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const keys = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
      if (keys[event.key]) {
        this.isFitted = false;
        this.turn += keys[event.key][0];
        this.tilt = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, this.tilt + keys[event.key][1]));
        this.draw();
      } else if (event.key === "+") this.near(1.25);
      else if (event.key === "-") this.near(0.8);
      else return;
      event.preventDefault();
    });
    for (const view of find("[data-view]")) {
      const factors = { near: 1.3, far: 1 / 1.3 };
      view.addEventListener("click", () => (view.dataset.view in factors ? this.near(factors[view.dataset.view]) : this.look(view.dataset.view)));
    }
    for (const box of find("[data-layer]")) {
      box.addEventListener("change", () => { this.layers[box.dataset.layer] = box.checked; this.draw(); });
    }
  }

  near(factor) {
    this.isFitted = false;
    this.zoom = Math.min(200, Math.max(0.1, this.zoom * factor));
    this.draw();
  }
}

const canvas = document.getElementById("solid");
const solid = canvas ? new Solid(canvas) : null;

// ---- one cursor over all plots -------------------------------------------------------------
const aside = document.getElementById("cursor");
const hairs = find("[data-time]").map((plot) => {
  const hair = make("div", "hair");
  hair.hidden = true;
  plot.append(hair);
  return { plot, hair, duration: Number(plot.dataset.time) || 1 };
});
const plane = document.getElementById("above");

// Row of the time that is nearest to a number of seconds.
const nearest = (seconds, times = data.seconds) => {
  let low = 0, high = times.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] < seconds) low = middle; else high = middle;
  }
  return seconds - times[low] < times[high] - seconds ? low : high;
};

const placeHairs = (seconds) => {
  for (const { hair, duration } of hairs) {
    hair.hidden = seconds === null;
    if (seconds !== null) hair.style.left = `${(100 * seconds) / duration}%`;
  }
};

// Where the cameras are at that time: in three dimensions and from above.
const placeCameras = (places) => {
  if (solid) { solid.cursors = places; solid.draw(); }
  plane?.querySelectorAll(".here").forEach((mark) => mark.remove());
  if (!plane) return;
  const [left, bottom, right, top] = plane.dataset.window.split(",").map(Number);
  const [x, y, sign] = plane.dataset.axes.split(",").map(Number);
  for (const at of places) {
    const here = make("div", "here");
    here.style.left = `${(100 * (at[x] - left)) / (right - left)}%`;
    here.style.top = `${(100 * (top - sign * at[y])) / (top - bottom)}%`;
    plane.append(here);
  }
};

const say = (parts) => {
  aside.hidden = parts === null;
  if (parts === null) return;
  const close = make("button", "", "×");
  close.type = "button";
  close.setAttribute("aria-label", "close");
  close.addEventListener("click", () => { putNothing(); history.replaceState(null, "", location.pathname); });
  aside.replaceChildren(...parts, close);
};

const putNothing = () => {
  placeHairs(null);
  placeCameras([]);
  say(null);
  for (const image of find(".here-too")) image.classList.remove("here-too");
};

const follow = (then) => {
  for (const { plot, duration } of hairs) {
    const move = (event) => {
      const box = plot.getBoundingClientRect();
      then((duration * (event.clientX - box.left)) / box.width);
    };
    plot.addEventListener("pointermove", move);
    plot.addEventListener("pointerdown", move);
  }
};

const stateNames = { OK: "tracked", LOST: "lost", NOT_INITIALIZED: "no map yet", DROPPED: "dropped", SKIPPED: "skipped" };

const words = (k) => {
  const state = data.states[data.state[k]], reason = data.reasons[data.reason[k]];
  const said = [`frame ${data.index[k]}`, `${data.seconds[k].toFixed(2)} s`, stateNames[state] ?? state];
  if (reason) said.push(reason);
  if (data.keyframe[k]) said.push("keyframe");
  if (data.error[k] !== null) said.push(`error ${data.error[k]} ${data.unit}`);
  if (state === "OK" && data.inliers[k] !== null) said.push(`${data.inliers[k]} inliers`);
  if (data.track[k] !== null) said.push(`${data.track[k]} ms`);
  return said;
};

const put = (k) => {
  putNothing();
  placeHairs(data.seconds[k]);
  const at = data.positions.slice(3 * k, 3 * k + 3);
  placeCameras(at[0] === null ? [] : [at]);
  document.getElementById(`image-${data.index[k]}`)?.classList.add("here-too");
  say(words(k).map((word) => make("span", "", word)));
};

if (data.seconds?.length) {
  follow((seconds) => put(nearest(seconds)));
  const go = () => {
    const number = /^#frame-(\d+)$/.exec(location.hash)?.[1];
    if (number === undefined) return;
    const wanted = Number(number);
    let best = 0;
    data.index.forEach((index, k) => { if (Math.abs(index - wanted) < Math.abs(data.index[best] - wanted)) best = k; });
    put(best);
    // From far below one would not see what the link has set: the plots are above.
    const image = document.getElementById(`image-${data.index[best]}`);
    const plot = document.querySelector("#plot-error, #plot-inliers");
    const box = plot?.getBoundingClientRect();
    if (image && clickedIn !== "images") image.scrollIntoView({ block: "center" });
    else if (box && (box.bottom < 0 || box.top > innerHeight)) plot.scrollIntoView({ block: "center" });
    clickedIn = "";
  };
  let clickedIn = "";
  document.addEventListener("click", (event) => {
    const link = event.target.closest?.('a[href^="#frame-"]');
    if (!link) return;
    clickedIn = link.closest("#images") ? "images" : "";
    if (link.getAttribute("href") === location.hash) go();
  });
  addEventListener("hashchange", go);
  go();
}

// ---- several runs: one moment of all of them ----------------------------------------------
if (data.runs?.length) {
  const wordsOf = (run, seconds) => {
    const line = make("span", "of-run");
    line.append(make("i", run.look), ` ${run.name}: `);
    const last = run.seconds.length - 1;
    if (last < 0 || seconds > run.seconds[last] + 0.5) { line.append("ended"); return line; }
    const k = nearest(seconds, run.seconds), said = [];
    if (run.state[k] !== "OK") said.push(stateNames[run.state[k]] ?? run.state[k]);
    if (run.error[k] !== null) said.push(`error ${run.error[k]} ${run.unit}`);
    if (run.inliers[k] !== null) said.push(`${run.inliers[k]} inliers`);
    if (run.track[k] !== null) said.push(`${run.track[k]} ms`);
    line.append(said.join(", ") || "-");
    return line;
  };
  const longest = Math.max(...data.runs.map((run) => run.seconds.at(-1) ?? 0));
  follow((wanted) => {
    const seconds = Math.min(longest, Math.max(0, wanted));
    placeHairs(seconds);
    placeCameras(data.paths.flatMap(({ positions, seconds: times }) => {
      const k = nearest(seconds, times), near = Math.abs(times[k] - seconds) < 0.5;
      return near ? [positions.slice(3 * k, 3 * k + 3)] : [];
    }));
    say([make("span", "", `${seconds.toFixed(2)} s`), ...data.runs.map((run) => wordsOf(run, seconds))]);
  });
}
document.body.dataset.ready = "yes";
