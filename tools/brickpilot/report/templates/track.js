"use strict";
// Draws a track from above, to one scale in both directions, and plays it. It follows the cursor of the figures of the same link.

const SPEEDS = [1, 2, 5, 10];

function extent(spec) {
  const xs = [...spec.lines.flatMap((one) => one.x), ...spec.circles.map((one) => one.x)];
  const ys = [...spec.lines.flatMap((one) => one.y), ...spec.circles.map((one) => one.y)];
  const margin = Math.max(...spec.circles.map((one) => 1.5 * one.radius), 0.05);
  return { left: Math.min(...xs) - margin, right: Math.max(...xs) + margin, low: Math.min(...ys) - margin, high: Math.max(...ys) + margin };
}

function oneScale(u, box) {
  const width = u.width - 52 - 14, height = u.height - 44 - 8;
  const metres = Math.max((box.right - box.left) / width, (box.high - box.low) / height);
  const x = (box.left + box.right) / 2, y = (box.low + box.high) / 2;
  return { x: [x - metres * width / 2, x + metres * width / 2], y: [y - metres * height / 2, y + metres * height / 2] };
}

function trail(state, played) { // draws a line; a played line ends at the present time
  return (u, i) => uPlot.orient(u, i, (series, xs, ys, sx, sy, toX, toY, left, top, width, height) => {
    const stroke = new Path2D(), clip = new Path2D();
    clip.rect(left, top, width, height);
    for (let k = 0; k < xs.length && !(played && state.time[k] > state.now); k++) {
      const place = [toX(xs[k], sx, width, left), toY(ys[k], sy, height, top)];
      k ? stroke.lineTo(...place) : stroke.moveTo(...place);
    }
    return { stroke, fill: null, clip, gaps: null, band: null, flags: 0 };
  });
}

function drawPlaces(u, spec, state) { // draws the waypoints, and the robot, which points along its heading
  const { ctx, bbox } = u, ratio = devicePixelRatio;
  const at = (x, y) => [u.valToPos(x, "x", true), u.valToPos(y, "y", true)];
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.lineWidth = 1.5 * ratio;
  ctx.font = `${12 * ratio}px system-ui, sans-serif`;
  ctx.textAlign = "center";
  ctx.textBaseline = "middle";
  for (const one of spec.circles) {
    const [x, y] = at(one.x, one.y);
    ctx.strokeStyle = one.reached ? palette.green : palette.orange;
    ctx.setLineDash(one.reached ? [] : [4 * ratio, 3 * ratio]);
    ctx.beginPath();
    ctx.arc(x, y, Math.max(at(one.x + one.radius, one.y)[0] - x, 7 * ratio), 0, 2 * Math.PI);
    ctx.stroke();
    ctx.fillStyle = palette.ink;
    ctx.fillText(one.name, x, y);
  }
  const k = sampleAt(state.time, state.now), size = 9 * ratio;
  ctx.translate(...at(spec.lines[state.robot].x[k], spec.lines[state.robot].y[k]));
  ctx.rotate(spec.heading[k]); // clockwise from straight up, as on the page
  ctx.beginPath();
  ctx.moveTo(0, -1.3 * size);
  ctx.lineTo(0.8 * size, size);
  ctx.lineTo(-0.8 * size, size);
  ctx.closePath();
  ctx.fillStyle = palette.blue;
  ctx.fill();
  ctx.restore();
}

function sampleAt(time, now) {
  let low = 0, high = time.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (time[middle] <= now) low = middle; else high = middle - 1;
  }
  return low;
}

function nearest(u, spec, state) { // returns the index of the sample under the cursor, or -1
  let best = -1, least = 20;
  const { x, y } = spec.lines[state.robot];
  for (let k = 0; k < x.length; k++) {
    const away = Math.hypot(u.valToPos(x[k], "x") - u.cursor.left, u.valToPos(y[k], "y") - u.cursor.top);
    if (away < least) [best, least] = [k, away];
  }
  return best;
}

function trackChart(holder, spec, state) {
  const full = extent(spec);
  const tall = (width) => Math.round(Math.min(Math.max(width * (full.high - full.low) / (full.right - full.left), 0.5 * width, 240), 560)) + 54;
  const plain = { stroke: () => palette.ink, grid: { stroke: () => palette.line, width: 1 }, ticks: { show: false }, font: "12px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif", labelSize: 18, labelGap: 0, values: (u, all) => all.map(shown) };
  const show = (u, box) => {
    state.box = box;
    const { x, y } = oneScale(u, box);
    u.batch(() => { u.setScale("x", { min: x[0], max: x[1] }); u.setScale("y", { min: y[0], max: y[1] }); });
  };
  const zoom = (u) => {
    const { left, top, width, height } = u.select;
    u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    if (width > 4 || height > 4) show(u, { left: u.posToVal(left, "x"), right: u.posToVal(left + width, "x"), low: u.posToVal(top + height, "y"), high: u.posToVal(top, "y") });
  };
  state.box = full;
  const facets = [{ scale: "x", auto: true }, { scale: "y", auto: true }];
  const u = new uPlot({
    mode: 2, title: spec.label, width: widthOf(holder), height: tall(widthOf(holder)), padding: [8, 14, 0, 0],
    scales: { x: { time: false, range: (u) => oneScale(u, state.box).x }, y: { range: (u) => oneScale(u, state.box).y } },
    axes: [{ ...plain, scale: "x", size: 26, label: spec.across }, { ...plain, scale: "y", size: 52 }],
    series: [{}, ...spec.lines.map((one, i) => ({ label: one.name, stroke: () => palette[one.colour], width: one.width, dash: one.dash ?? undefined, facets, points: { show: false }, paths: trail(state, one.played) }))],
    cursor: { x: false, y: false, points: { show: false }, dataIdx: () => null, drag: { x: true, y: true, setScale: false }, bind: { dblclick: (u) => () => show(u, full) } },
    legend: { live: false, markers: { width: 2, stroke: (u, i) => `var(--${spec.lines[i - 1].colour})`, fill: (u, i) => `var(--${spec.lines[i - 1].colour})` } },
    hooks: { draw: [(u) => drawPlaces(u, spec, state)], setSelect: [zoom] },
  }, [null, ...spec.lines.map((one) => [one.x, one.y])], holder);
  byKeyboard(u);
  return { holder, chart: u, height: tall, link: spec.link };
}

function playerOf(holder, state, seek) {
  const bar = document.createElement("div"), button = document.createElement("button"), slider = document.createElement("input");
  const speed = document.createElement("select"), clock = document.createElement("output");
  const end = state.time.at(-1);
  Object.assign(slider, { type: "range", min: state.time[0], max: end, step: "any", value: end });
  slider.setAttribute("aria-label", "time of the run, in s");
  speed.setAttribute("aria-label", "times real time");
  for (const times of SPEEDS) speed.add(new Option(`${times} ×`, times, times === 2, times === 2));
  let since = 0, playing = false;
  const play = (on) => {
    playing = on;
    button.textContent = on ? "Pause" : "Play";
    if (on) { since = 0; requestAnimationFrame(tick); }
  };
  const tick = (now) => {
    if (!playing) return;
    if (since) seek(Math.min(state.now + (now - since) / 1000 * speed.value, end));
    since = now;
    state.now >= end - 1e-6 ? play(false) : requestAnimationFrame(tick);
  };
  button.type = "button";
  button.addEventListener("click", () => { if (!playing && state.now >= end - 1e-6) seek(state.time[0]); play(!playing); });
  slider.addEventListener("input", () => { play(false); seek(+slider.value); });
  play(false);
  bar.className = "player";
  bar.append(button, slider, clock, speed);
  holder.append(bar);
  return { show: (now) => { slider.value = now; clock.textContent = `${now.toFixed(2)} s`; }, pause: () => play(false) };
}

function drawTrack(holder, spec) {
  const state = { time: spec.time, now: spec.time.at(-1), robot: spec.lines.findIndex((one) => one.played) };
  const one = trackChart(holder, spec, state);
  const move = (now) => { state.now = now; one.chart.redraw(); player.show(now); };
  const seek = (now) => { // moves the cursors of the figures too
    move(now);
    const other = drawn.find((peer) => peer !== one && peer.link === spec.link);
    if (other) other.chart.setCursor({ left: other.chart.valToPos(now, "x"), top: 1 }, true, true);
  };
  const player = playerOf(holder, state, seek);
  player.show(state.now);
  drawn.push(one);
  one.chart.over.addEventListener("mousemove", () => { const k = nearest(one.chart, spec, state); if (k >= 0) { player.pause(); seek(spec.time[k]); } });
  if (spec.link) uPlot.sync(spec.link).sub({ pub: (kind, from, left) => {
    if (kind === "mousemove" && left >= 0) move(Math.min(Math.max(from.posToVal(left, "x"), spec.time[0]), spec.time.at(-1)));
  } });
  addEventListener("beforeprint", () => move(spec.time.at(-1)));
}
