// The view of a report: a map of signals and phases, a map of grasps (or windows) and phases, and the traces of one of
// them. Reads the JSON of view.py; names from files are set as text only.
"use strict";
document.documentElement.classList.add("js");
document.querySelector(".theme").onclick = () => {
  const root = document.documentElement, dark = matchMedia("(prefers-color-scheme: dark)").matches;
  root.dataset.theme = (root.dataset.theme || (dark ? "dark" : "light")) === "dark" ? "light" : "dark";
};

function node(name, attributes = {}, children = []) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) key in made ? (made[key] = value) : made.setAttribute(key, value);
  made.append(...children);
  return made;
}

function shape(parent, name, attributes, text = "") {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.textContent = text;
  parent.append(made);
  return made;
}

// a value as short as it can be told from its neighbours, which are `step` apart
const short = (value, step) => value.toFixed(Math.min(6, Math.max(0, Math.ceil(-Math.log10(step) - 1e-9))));

function ticks(low, high, most) {
  const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map(k => k * power).find(s => s >= rough), found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push([k * step, short(k * step, step)]);
  return found;
}

function showView(place, data) {
  const phases = data.phases.map((name, k) => k).filter(k => data.errors[0].some(row => row[k] != null));
  const top = Math.log(Math.max(2, ...data.errors.flat(2).map(Number), ...data.parts.flatMap(p => p.errors.flat(2).map(Number))));
  const chosen = { model: 0, signal: 0, part: 0, phase: null, range: null, byError: data.by_error };

  const worstOf = rows => rows.reduce((best, row) => (row[0] > best[0] ? row : best), [-1]);
  const errorOf = (part, signal = chosen.signal) => Math.max(...part.errors[chosen.model][signal].map(Number));
  const worstPart = phase =>
    worstOf(data.parts.map((p, k) => [phase == null ? errorOf(p) : p.errors[chosen.model][chosen.signal][phase] ?? -1, k]))[1];

  const model = node("select", { "aria-label": "model", onchange: () => { chosen.model = +model.value; draw(); } },
    data.models.map((name, k) => node("option", { value: k, textContent: `error of the ${name}` })));
  model.hidden = data.models.length < 2;
  const order = node("button", { type: "button", onclick: () => { chosen.byError = !chosen.byError; draw(); } });
  const picker = node("select", { "aria-label": data.part, onchange: () => pick(+picker.value) },
    data.parts.map((p, k) => node("option", { value: k, textContent: p.name })));
  const step = by => () => {
    const rows = ordered();
    pick(rows[(rows.indexOf(chosen.part) + by + rows.length) % rows.length]);
  };
  const button = (text, label, onclick) => node("button", { type: "button", textContent: text, ariaLabel: label, onclick });
  const overview = node("div", { className: "map overview" }), each = node("div", { className: "map each" });
  const charts = node("div", { className: "charts" }), readout = node("p", { className: "readout" }), title = node("p");
  charts.classList.toggle("two", data.models.length > 1);
  const legend = node("p", {}, ["● measured", ...data.models.flatMap((name, k) =>
    [node("span", { className: "key", style: `color: var(--${data.models.length > 1 && k === 0 ? "orange" : "blue"})` }), name]),
    ...(data.parts[0].command.length ? [" ··· command"] : [])]);
  place.append(
    node("div", {}, [node("p", { textContent: `Error ÷ noise of all ${data.parts.length} ${data.part}s. Click a cell to see where it is worst.` }),
      model, overview, node("div", { className: "bar" }, [title, order]), each]),
    node("div", {}, [node("div", { className: "bar" }, [button("‹", "previous", step(-1)), picker, button("›", "next", step(1)),
      button("+", "zoom in", () => zoomBy(0.5)), button("−", "zoom out", () => zoomBy(2)), button(`whole ${data.part}`, "", () => zoom(null))]),
      legend, charts, readout, node("p", { textContent: "Drag across a trace to zoom in, double-click for all of it."
        + (data.every > 1 ? ` One of ${data.every} samples is drawn.` : "") })]));

  const ordered = () => {
    const rows = data.parts.map((p, k) => k);
    return chosen.byError ? rows.sort((a, b) => errorOf(data.parts[b]) - errorOf(data.parts[a])) : rows;
  };

  function pick(part, phase = null) {
    [chosen.part, chosen.phase] = [part, phase];
    const inside = data.parts[part].spans.filter(span => span[0] === phase);
    if (inside.length) {
      const [, low, high] = worstOf(inside.map(span => [span[2] - span[1], span[1], span[2]]));
      const margin = 0.15 * (high - low) + 0.02;
      chosen.range = [low - margin, high + margin];
    } else chosen.range = null;
    draw();
    if (phase != null && innerWidth < 960) charts.scrollIntoView({ block: "nearest" });
  }

  const whole = () => [data.parts[chosen.part].time[0], data.parts[chosen.part].time.at(-1)];
  function zoom(range) {
    if (range) range = [Math.max(range[0], whole()[0]), Math.min(range[1], whole()[1])];
    chosen.range = range && range[1] > range[0] ? range : null;
    drawCharts();
  }
  function zoomBy(factor) {
    const [low, high] = chosen.range || whole(), middle = (low + high) / 2, half = (factor * (high - low)) / 2;
    zoom([middle - half, middle + half]);
  }

  // a table of cells: rows are [name, errors by phase, whether it is chosen, what a click on a phase does]
  function drawMap(map, rows) {
    const at = map.scrollTop, focused = map.contains(document.activeElement) && document.activeElement.dataset.at;
    const cell = (value, pressed, where, click) => {
      if (value == null) return node("td");
      const strength = Math.log(Math.max(1, value)) / top;
      const made = node("button", { type: "button", textContent: value < 100 ? value.toFixed(1) : value.toFixed(0), ariaPressed: pressed, onclick: click });
      made.style.background = `rgba(226, 110, 20, ${0.06 + 0.9 * strength})`;
      made.style.color = `light-dark(#000, ${strength > 0.7 ? "#000" : "#fff"})`;
      made.dataset.at = where;
      return node("td", {}, [made]);
    };
    map.replaceChildren(node("table", {}, [
      node("thead", {}, [node("tr", {}, [node("th"), ...phases.map(k => node("th", { textContent: data.phases[k] }))])]),
      node("tbody", {}, rows.map(([name, errors, pressed, click], row) => node("tr", { className: pressed ? "chosen-row" : "" }, [node("th", { textContent: name, title: name }),
        ...phases.map(k => cell(errors[k], pressed && k === chosen.phase, `${row} ${k}`, () => click(k)))])))]));
    map.scrollTop = at;
    if (focused) map.querySelector(`[data-at="${focused}"]`)?.focus({ preventScroll: true });
  }

  function draw() {
    drawMap(overview, data.signals.map((signal, k) => [signal.name, data.errors[chosen.model][k], k === chosen.signal,
      phase => { chosen.signal = k; pick(worstPart(phase), phase); }]));
    title.textContent = `${data.signals[chosen.signal].name}, ${data.part} by ${data.part}`;
    drawMap(each, ordered().map(k => [data.parts[k].name, data.parts[k].errors[chosen.model][chosen.signal], k === chosen.part,
      phase => pick(k, phase)]));
    order.textContent = chosen.byError ? "in their order" : "worst first";
    picker.value = chosen.part;
    drawCharts();
  }

  function drawCharts() {
    charts.replaceChildren();
    readout.textContent = "";
    const side = [chosen.signal, ...data.sides[chosen.signal].filter(k => k !== chosen.signal)];
    side.forEach((signal, row) => drawSignal(signal, row === 0 ? 230 : 150));
  }

  function drawSignal(signal, height) {
    const part = data.parts[chosen.part], { name, unit, step } = data.signals[signal], time = part.time, [low, high] = chosen.range || whole();
    const width = Math.max(260, charts.clientWidth), left = 58, right = width - 8, below = 0.55 * height, gap = 26, full = height + gap + below + 22;
    const svg = shape(charts, "svg", { height: full, viewBox: `0 0 ${width} ${full}`, role: "img", "aria-label": `${name} of ${part.name}` });
    const x = t => left + ((t - low) / (high - low || 1)) * (right - left);
    const within = time.map((t, k) => k).filter(k => time[k] >= low && time[k] <= high), every = Math.ceil(within.length / 1500);
    const inside = within.filter((k, place) => place % every === 0);
    // what a model says where it is not counted, such as at a start whose forces nobody knows, must not flatten all else
    const counts = k => !part.spans.some(([phase, from, to]) => phase < 0 && time[k] >= from && (time[k] < to || k === time.length - 1));
    const counted = inside.filter(counts), scaled = counted.length ? counted : inside;
    // a line goes on to the edges of what is seen
    const drawn = inside.length ? [...new Set([Math.max(0, inside[0] - 1), ...inside, Math.min(time.length - 1, inside.at(-1) + 1)])] : [];
    const measured = part.measured[signal], models = part.predicted.map(p => p[signal]);

    function panel(y0, y1, curves, factor, dots, always, label, extra) {
      const values = [...always, ...curves.flatMap((c, n) => (dots && n === 0 ? inside : scaled).map(k => factor * c[k]))], bottom = Math.min(...values), ceiling = Math.max(...values);
      const margin = 0.06 * (ceiling - bottom) || factor;
      const y = v => y1 - ((v - bottom + margin) / (ceiling - bottom + 2 * margin)) * (y1 - y0);
      const inner = shape(svg, "svg", { x: left, y: y0, width: right - left, height: y1 - y0, viewBox: `${left} ${y0} ${right - left} ${y1 - y0}` });
      extra(inner, y);
      for (const [at, text] of ticks(bottom - margin, ceiling + margin, (y1 - y0) / 42)) {
        shape(svg, "path", { class: "axis", d: `M${left} ${y(at)}H${right}` });
        shape(svg, "text", { x: left - 5, y: y(at) + 4, "text-anchor": "end" }, text);
      }
      curves.forEach((curve, k) => {
        if (dots && k === 0) for (const i of inside) shape(inner, "circle", { class: "measured", r: 1.8, cx: x(time[i]), cy: y(factor * curve[i]) });
        else shape(inner, "path", { class: `line m${dots ? k - 1 : k}`, d: "M" + drawn.map(i => `${x(time[i]).toFixed(1)} ${y(factor * curve[i]).toFixed(1)}`).join("L") });
      });
      shape(svg, "text", { class: "title", x: left, y: y0 - 6 }, label);
      return [inner, y];
    }

    const start = height - 4, residuals = models.map(m => measured.map((v, k) => v - m[k]));
    const [inner, y] = panel(20, start, [measured, ...models], step, true, inside.length ? [] : [0, 1], `${name} [${unit}]`, g => {
      part.spans.forEach(([phase, from, to], k) => {
        if (k % 2) shape(g, "rect", { class: "band", x: x(from), y: 20, width: Math.max(0, x(to) - x(from)), height: start - 20 });
        const seen = Math.max(left, x(from)), word = phase < 0 ? "not counted" : data.phases[phase];
        if (Math.min(right, x(to)) - seen > 7 * word.length + 8) shape(g, "text", { x: seen + 4, y: start - 5 }, word);
      });
    });
    if (part.command[signal]) {
      let path = "";
      drawn.forEach((i, k) => { const at = y(step * part.command[signal][i]).toFixed(1); path += k ? `H${x(time[i]).toFixed(1)}V${at}` : `M${x(time[i]).toFixed(1)} ${at}`; });
      shape(inner, "path", { class: "line command", d: path });
    }
    panel(height + gap, height + gap + below, residuals, data.noise, false, [-3, 3], "measured − model, ÷ noise", (g, y) => {
      shape(g, "rect", { class: "band", x: left, y: y(2), width: right - left, height: y(-2) - y(2) });
      shape(g, "path", { class: "zero", d: `M${left} ${y(0)}H${right}` });
    });
    for (const [at, text] of ticks(low, high, (right - left) / 80)) shape(svg, "text", { x: x(at), y: full - 4, "text-anchor": "middle" }, text + " s");
    listen(svg, x, left, right, low, high, full, at => {
      const k = time.reduce((best, t, i) => (Math.abs(t - at) < Math.abs(time[best] - at) ? i : best), 0), say = v => `${short(step * v, step)} ${unit}`;
      readout.textContent = `${name}, ${time[k].toFixed(3)} s: measured ${say(measured[k])}; ` + data.models.map((m, j) =>
        `${m} ${say(models[j][k])}, off by ${say(residuals[j][k])} (${(data.noise * residuals[j][k]).toFixed(1)} × noise)`).join("; ");
    });
  }

  // reads values off under the pointer, and zooms where it is dragged
  function listen(svg, x, left, right, low, high, full, read) {
    const time = event => { const box = svg.getBoundingClientRect();
      return Math.min(high, Math.max(low, low + (((event.clientX - box.left) * svg.viewBox.baseVal.width) / box.width - left) / (right - left) * (high - low))); };
    const cursor = shape(svg, "path", { class: "cursor" }), area = shape(svg, "rect", { class: "chosen", y: 0, height: full, width: 0 });
    let from = null;
    const ended = () => { from = null; area.setAttribute("width", 0); };
    svg.onpointerdown = event => { from = time(event); svg.setPointerCapture(event.pointerId); };
    svg.onpointermove = event => {
      const at = time(event);
      cursor.setAttribute("d", `M${x(at)} 0V${full}`);
      read(at);
      if (from != null) { area.setAttribute("x", Math.min(x(from), x(at))); area.setAttribute("width", Math.abs(x(at) - x(from))); }
    };
    svg.onpointerup = event => {
      const both = [from, time(event)].sort((a, b) => a - b);
      const far = from != null && x(both[1]) - x(both[0]) > 8;
      ended();
      if (far) zoom(both);
    };
    svg.onpointercancel = ended;
    svg.ondblclick = () => zoom(null);
  }

  [, chosen.signal] = worstOf(data.signals.map((s, k) => [Math.max(...data.errors[0][k].map(Number)), k]));
  chosen.part = worstPart(null);
  draw();
  let width = charts.clientWidth;
  new ResizeObserver(() => { if (charts.clientWidth !== width) { width = charts.clientWidth; drawCharts(); } }).observe(charts);
}

for (const place of document.querySelectorAll(".view")) showView(place, JSON.parse(place.firstElementChild.textContent));
