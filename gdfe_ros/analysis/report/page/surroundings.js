"use strict";
// Everything around and inside of the body: obstacles and rigid bodies, chambers, cables, contact forces.

const LEVELS = 65535;
const read = (id) => JSON.parse(document.getElementById(id).textContent);
const element = (id) => document.getElementById(id);

function bytes(id) {
  const text = atob(element(id).textContent);
  const data = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) data[i] = text.charCodeAt(i);
  return data.buffer;
}

const unpacked = {};

// Points `first` to `first + count` of a kind [m]: three arrays.
function pointsOf(around, kind, first, count) {
  unpacked[kind] ??= new Uint16Array(bytes(`around-${kind}`));
  const axes = [0, 1, 2].map(() => new Array(count));
  for (let p = 0; p < count; p++) {
    for (let axis = 0; axis < 3; axis++) {
      const level = unpacked[kind][3 * (first + p) + axis];
      axes[axis][p] = around.low[axis] + (level / LEVELS) * (around.high[axis] - around.low[axis]);
    }
  }
  return axes;
}

// Points as lines of the given numbers of points, broken by gaps.
function asLines(points, lengths) {
  return points.map((values) => {
    const line = [];
    let from = 0;
    for (const length of lengths) {
      line.push(...values.slice(from, from + length), null);
      from += length;
    }
    return line;
  });
}

// Points of solids, chambers, cables and forces in a frame, in the order of the traces.
function aroundPoints(around, frame) {
  const of = (kind) => pointsOf(around, kind, frame * around.counts[kind], around.counts[kind]);
  const before = around.forces.slice(0, frame).reduce((sum, count) => sum + count, 0);
  const count = around.forces[frame] || 0;
  const pairs = new Array(count / 2).fill(2);
  const forces = pointsOf(around, "forces", before, count);
  return [of("solids"), of("chambers"), asLines(of("cables"), around.cables), asLines(forces, pairs)];
}

// Chambers are inside of the body and are only shown with it translucent.
function aroundVisible(around, inside) {
  return [around.counts.solids > 0, inside && around.counts.chambers > 0, around.counts.cables > 0, around.largest > 0];
}

function aroundTraces(around) {
  const solid = (kind, color, opacity) => {
    const count = around.counts[kind];
    const [i, j, k] = [0, 1, 2].map((corner) => Array.from({ length: count / 3 }, (_, face) => 3 * face + corner));
    return { type: "mesh3d", x: [], y: [], z: [], i, j, k, color, opacity, flatshading: true, hoverinfo: "skip" };
  };
  const lines = (color, width, name) => ({
    type: "scatter3d", mode: "lines", x: [], y: [], z: [], line: { color, width }, hoverinfo: "skip", name,
    showlegend: Boolean(name),
  });
  const label = around.largest > 0 ? `contact forces, largest ${around.largest.toPrecision(3)} N` : "";
  return [
    solid("solids", "rgb(204,158,115)", 0.45), solid("chambers", "rgb(140,204,255)", 0.4),
    lines("rgb(191,26,26)", 5, ""), lines("rgb(242,38,140)", 5, label),
  ];
}

// The box of the body over the run, and of the things around it as far as half of the body's largest extent.
function viewRanges(run) {
  const reach = 0.5 * Math.max(...run.low.map((low, axis) => run.high[axis] - low));
  const around = run.around;
  return run.low.map((low, axis) => [
    Math.min(low, Math.max(around.low[axis], low - reach)),
    Math.max(run.high[axis], Math.min(around.high[axis], run.high[axis] + reach)),
  ]);
}

