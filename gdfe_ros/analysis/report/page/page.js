// One view of the run: a slider moves the surface, and a line in every chart shows the same moment.

const SCALE = "Viridis";
const charts = read("chart-data");
const run = read("animation");

const faces = new Uint32Array(run ? bytes("faces") : 0);
const positions = new Uint16Array(run ? bytes("positions") : 0);
const colours = {};

// Colours are unpacked when they are first asked for.
function levels(field) {
  colours[field.id] ??= new Uint16Array(bytes(field.id));
  return colours[field.id];
}

// Coordinates of a frame [m]: three arrays, one number a vertex.
function coordinates(frame) {
  const axes = [0, 1, 2].map(() => new Float32Array(run.vertices));
  const start = 3 * run.vertices * frame;
  for (let v = 0; v < run.vertices; v++) {
    for (let axis = 0; axis < 3; axis++) {
      const level = positions[start + 3 * v + axis];
      axes[axis][v] = run.low[axis] + (level / LEVELS) * (run.high[axis] - run.low[axis]);
    }
  }
  return axes;
}

// The vertices of a face: three of a skin, four of a cell.
function cornersOf(face) {
  return faces.subarray(run.corners * face, run.corners * (face + 1));
}

// A face of four vertices is drawn as two triangles.
function triangles() {
  const corners = [[], [], []];
  for (let f = 0; f < run.faces; f++) {
    const [a, b, c, d] = cornersOf(f);
    const parts = run.corners === 4 ? [[a, b, c], [a, c, d]] : [[a, b, c]];
    parts.forEach((three) => three.forEach((v, k) => corners[k].push(v)));
  }
  return corners;
}

function intensity(field, frame) {
  const source = levels(field);
  const parts = run.corners - 2;
  const values = new Float32Array(parts * run.faces);
  for (let f = 0; f < run.faces; f++) {
    const value = field.low + (source[run.faces * frame + f] / LEVELS) * (field.high - field.low);
    values.fill(value, parts * f, parts * (f + 1));
  }
  return values;
}

// Unit normals of the vertices, out of the body: three arrays.
function normals(axes) {
  const sums = axes.map((values) => new Float32Array(values.length));
  const [first, second] = run.corners === 4 ? [[0, 2], [1, 3]] : [[0, 1], [0, 2]];
  for (let f = 0; f < run.faces; f++) {
    const corners = cornersOf(f);
    const [u, v] = [first, second].map(([from, to]) => axes.map((values) => values[corners[to]] - values[corners[from]]));
    for (let axis = 0; axis < 3; axis++) {
      const [b, c] = [(axis + 1) % 3, (axis + 2) % 3];
      const part = u[b] * v[c] - u[c] * v[b];
      for (const corner of corners) sums[axis][corner] += part;
    }
  }
  for (let v = 0; v < run.vertices; v++) {
    const length = Math.hypot(sums[0][v], sums[1][v], sums[2][v]) || 1;
    for (let axis = 0; axis < 3; axis++) sums[axis][v] /= length;
  }
  return sums;
}

// The outlines of all faces as one line, broken by gaps; they float a little above the surface, which would hide them.
function outlines(axes) {
  const out = normals(axes);
  const lift = 0.001 * Math.max(...run.low.map((low, axis) => run.high[axis] - low));
  return axes.map((values, axis) => {
    const length = run.corners + 2;
    const line = new Array(length * run.faces).fill(null);
    for (let f = 0; f < run.faces; f++) {
      const corners = cornersOf(f);
      for (let k = 0; k <= run.corners; k++) {
        const v = corners[k % run.corners];
        line[length * f + k] = values[v] + lift * out[axis][v];
      }
    }
    return line;
  });
}

function fieldLabel(field) {
  return field.unit ? `${field.label} [${field.unit}]` : field.label;
}

function chosenField() {
  return run.fields[Number(element("field").value) || 0];
}

function drawMesh() {
  const [i, j, k] = triangles();
  const axes = coordinates(0);
  const field = chosenField();
  const surface = {
    type: "mesh3d", x: axes[0], y: axes[1], z: axes[2], i, j, k, hoverinfo: "skip", flatshading: run.corners === 4,
    lighting: { ambient: 0.75, diffuse: 0.4, specular: 0.05 }, color: "#8fa6c6",
  };
  if (field) Object.assign(surface, colouring(field, 0));
  const edges = {
    type: "scatter3d", mode: "lines", x: [], y: [], z: [], hoverinfo: "skip", showlegend: false,
    line: { color: "rgb(20,25,35)", width: 1 }, opacity: 0.5,
  };
  const ranges = viewRanges(run);
  const widest = Math.max(...ranges.map(([low, high]) => high - low)) || 1;
  const axisLayout = (axis) => {
    const [low, high] = ranges[axis];
    const half = 0.5 * Math.max(1.06 * (high - low), 0.05 * widest);
    return { range: [0.5 * (low + high) - half, 0.5 * (low + high) + half], title: { text: "xyz"[axis] + " [m]" } };
  };
  const layout = {
    margin: { l: 0, r: 0, t: 0, b: 0 }, uirevision: "keep", paper_bgcolor: "rgba(0,0,0,0)",
    scene: {
      xaxis: axisLayout(0), yaxis: axisLayout(1), zaxis: axisLayout(2), aspectmode: "data",
      camera: { eye: { x: 0.85, y: -2.2, z: 0.85 } },
    },
  };
  const traces = [surface, edges, ...aroundTraces(run.around)];
  return Plotly.newPlot("mesh", traces, layout, { responsive: true, displayModeBar: false });
}

function colouring(field, frame) {
  return {
    intensity: intensity(field, frame), intensitymode: "cell", colorscale: SCALE, cmin: field.low, cmax: field.high,
    colorbar: { title: { text: fieldLabel(field), side: "right" }, thickness: 14, len: 0.8 },
  };
}

function showFrame(frame) {
  const axes = coordinates(frame);
  const lines = element("edges").checked ? outlines(axes) : [[], [], []];
  const shown = [axes, lines, ...aroundPoints(run.around, frame)];
  const change = { x: shown.map((each) => each[0]), y: shown.map((each) => each[1]), z: shown.map((each) => each[2]) };
  const rest = shown.slice(1).map(() => undefined);
  const field = chosenField();
  if (field) {
    for (const [name, value] of Object.entries(colouring(field, frame))) {
      if (name !== "colorscale") change[name] = [value, ...rest];
    }
  }
  change.opacity = [element("inside").checked ? 0.3 : 1, ...rest];
  change.visible = [true, true, ...aroundVisible(run.around, element("inside").checked)];
  element("moment").textContent =
    `t = ${run.times[frame].toPrecision(5)} s, frame ${frame + 1} of ${run.times.length}` +
    (run.failed[frame] ? ", not converged" : "");
  document.body.dataset.frame = String(frame);
  markMoment(run.times[frame]);
  return Plotly.restyle("mesh", change, shown.map((_, place) => place));
}

function drawCharts() {
  // All boxes first: a chart takes the width that its box has when it is drawn.
  for (const [place, chart] of charts.entries()) {
    const section = document.createElement("section");
    const heading = document.createElement("h2");
    const plot = document.createElement("div");
    heading.textContent = chart.title;
    plot.className = "chart";
    plot.id = `chart-${place}`;
    section.append(heading, plot);
    element("charts").append(section);
  }
  return Promise.all(charts.map((chart, place) => {
    const layout = {
      margin: { l: 64, r: 12, t: 6, b: 42 }, font: { size: 12 }, hovermode: "closest",
      legend: { orientation: "h", y: 1.02, yanchor: "bottom" }, ...chart.layout,
    };
    return Plotly.newPlot(`chart-${place}`, chart.data, layout, { responsive: true, displayModeBar: false });
  }));
}

function markMoment(time) {
  const line = { type: "line", xref: "x", yref: "paper", x0: time, x1: time, y0: 0, y1: 1 };
  const shapes = [{ ...line, line: { color: "rgba(29,36,48,0.45)", width: 1 } }];
  for (const plot of document.querySelectorAll(".chart")) Plotly.relayout(plot, { shapes });
}

// Frames follow each other as fast as they can be drawn, at most thirty a second.
let playing = false;
async function play() {
  const slider = element("time");
  playing = !playing;
  element("play").textContent = playing ? "\u23F8" : "\u25B6";
  while (playing) {
    slider.value = String((Number(slider.value) + 1) % run.times.length);
    await showFrame(Number(slider.value));
    await new Promise((done) => setTimeout(done, 33));
  }
}

function start() {
  const drawn = drawCharts();
  if (!run || !run.times.length) {
    if (run) element("body").innerHTML = "<p>The bag holds no mesh messages.</p>";
    else element("body").remove();
    drawn.then(() => { document.body.dataset.ready = "yes"; });
    return;
  }
  for (const [place, field] of run.fields.entries()) element("field").add(new Option(fieldLabel(field), String(place)));
  element("edges").checked = run.corners === 4; // A skin is smooth.
  const slider = element("time");
  slider.max = String(run.times.length - 1);
  const show = () => showFrame(Number(slider.value));
  slider.addEventListener("input", show);
  element("field").addEventListener("change", show);
  element("edges").addEventListener("change", show);
  element("inside").addEventListener("change", show);
  element("see-inside").hidden = !(run.around.counts.chambers + run.around.counts.cables);
  element("play").addEventListener("click", play);
  drawMesh().then(() => {
    slider.value = String(run.first);
    return Promise.all([drawn, show()]);
  }).then(() => { document.body.dataset.ready = "yes"; });
}

start();
