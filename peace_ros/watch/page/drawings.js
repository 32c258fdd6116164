// Copyright 2026 The peace_ros authors
// SPDX-License-Identifier: Apache-2.0
// The drawings of the page: marks in the camera picture, map, altitude bar, timeline. All are SVG,
// so that colours follow the theme and a screen reader reaches every place.

const SVG = 'http://www.w3.org/2000/svg';

export function element(name, attributes = {}, ...children) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

export const LEVELS = {
  HANDOVER: 'good', LANDING: 'active', AIMING: 'active', SEARCHING: 'active', RESTARTING: 'active',
  WAITING: 'warn', CLIMBING: 'warn', RETURNING: 'warn', HOLD: 'bad', ABORTED: 'bad', FAILED: 'bad',
};

export function words(place, kind) {
  if (kind === 'site') {
    return `Site: ${place.clearance_m.toFixed(1)} m of clearance, score ${place.confidence.toFixed(2)}, ` +
      `${place.distance_m === undefined ? '' : `${place.distance_m.toFixed(0)} m away, `}seen ${place.age_s.toFixed(1)} s ago`;
  }
  return `Refused, ${place.distance_m.toFixed(0)} m away: ${place.reason}`;
}

// A mark is read by pointing at it, by a tap, or by the Tab key.
function place(kind, text, caption, ...shapes) {
  const group = element('g', { tabindex: '0', role: 'img', 'aria-label': text, 'data-kind': kind },
    element('title', {}, text), ...shapes);
  const show = () => { caption.textContent = text; };
  for (const event of ['pointerenter', 'focus', 'click']) group.addEventListener(event, show);
  return group;
}

// Replaces the children of a drawing, and keeps the keyboard on the place it was on.
function redraw(svg, parts) {
  const active = svg.contains(document.activeElement) ? document.activeElement.dataset.kind : null;
  svg.replaceChildren(...parts);
  if (active) svg.querySelector(`[data-kind="${active}"]`)?.focus({ preventScroll: true });
}

function about(state, kind) {
  if (kind === 'site') return state.site && words(state.site, 'site');
  const refused = state.refused[Number(kind.split(' ')[1]) - 1];
  return refused && words(refused, kind);
}

export function drawCameraMarks(svg, caption, marks, state) {
  const parts = [];
  for (const mark of marks) {
    const corners = mark.corners.map(([u, v]) => `${u},${v}`).join(' ');
    const name = mark.kind.split(' ')[0];
    const shapes = ['under', name].map((style) => element('polygon', { points: corners, class: `mark ${style}` }));
    const text = name === 'focus' ? null : about(state, mark.kind);
    if (text) parts.push(place(mark.kind, text, caption, ...shapes));
    else if (name === 'focus') parts.push(...shapes);
  }
  redraw(svg, parts);
}

export function drawMap(svg, caption, state, samples, ground) {
  const known = samples.filter((each) => each.north_m !== null && each.east_m !== null);
  const at = state.north_m === null || state.east_m === null ? null : [state.east_m, -state.north_m];
  const places = [...state.refused, ...(state.site ? [state.site] : [])];
  const middle = at ?? (ground ? [ground.west_m + ground.width_m / 2, -(ground.south_m + ground.height_m / 2)] : [0, 0]);
  const reach = Math.min(120, Math.max(45, ...places.map((each) =>
    Math.max(Math.abs(each.east_m - middle[0]), Math.abs(-each.north_m - middle[1])) + each.clearance_m + 5)));
  // In steps, so that the map does not breathe.
  const half = Math.ceil(reach / 15) * 15;
  svg.setAttribute('viewBox', `${middle[0] - half} ${middle[1] - half} ${2 * half} ${2 * half}`);
  const unit = half / 100;
  const parts = [];
  if (ground) {
    parts.push(element('image', { href: ground.url, x: ground.west_m, y: -(ground.south_m + ground.height_m),
      width: ground.width_m, height: ground.height_m, preserveAspectRatio: 'none' }));
  }
  const circle = (north, east, radius, style) => element('circle', { cx: east, cy: -north, r: radius, class: style });
  if (state.home) {
    const [north, east] = state.home;
    for (const name of ['geofence_radius_m', 'search_radius_m']) {
      if (state.limits[name] > 0) parts.push(circle(north, east, state.limits[name], 'fence'));
    }
    parts.push(circle(north, east, 2 * unit, 'home'));
  }
  if (known.length > 1) {
    parts.push(element('polyline', { points: known.map((each) => `${each.east_m},${-each.north_m}`).join(' '), class: 'path' }));
  }
  if (state.focus) parts.push(circle(state.focus.north_m, state.focus.east_m, state.focus.radius_m, 'mark focus'));
  state.refused.forEach((each, index) => {
    parts.push(place(`refused ${index + 1}`, words(each, 'refused'), caption,
      circle(each.north_m, each.east_m, Math.max(each.clearance_m, 2 * unit), 'mark refused'),
      // Beside a circle that is too small to hold its number.
      element('text', { x: each.east_m + (each.clearance_m > 6 * unit ? 0 : Math.max(each.clearance_m, 2 * unit) + 3 * unit),
        y: -each.north_m + 3 * unit, 'font-size': 8 * unit, 'text-anchor': 'middle' }, String(index + 1))));
  });
  if (state.site) {
    parts.push(place('site', words(state.site, 'site'), caption,
      circle(state.site.north_m, state.site.east_m, state.site.clearance_m, 'mark site'),
      element('text', { x: state.site.east_m, y: -state.site.north_m + 3 * unit, 'font-size': 9 * unit, 'text-anchor': 'middle' }, 'H')));
  }
  if (at) {
    const [x, y] = at;
    parts.push(element('path', { class: 'vehicle',
      d: `M${x} ${y - 4 * unit} L${x + 4 * unit} ${y} L${x} ${y + 4 * unit} L${x - 4 * unit} ${y} Z` }));
  }
  const length = half > 60 ? 50 : 20;
  const left = middle[0] - 0.93 * half, low = middle[1] + 0.92 * half;
  parts.push(element('line', { x1: left, y1: low, x2: left + length, y2: low, class: 'scale' }),
    element('text', { x: left, y: low - 3 * unit, 'font-size': 7 * unit }, `${length} m`));
  redraw(svg, parts);
}

export function drawAltitude(svg, text, state) {
  const { altitude_agl_m: altitude, limits } = state;
  const top = Math.max(100, altitude ?? 0, (limits.safe_altitude_m ?? 0) * 1.5);
  const x = (metres) => 5 + 390 * Math.min(1, Math.max(0, metres / top));
  const parts = [element('rect', { x: 5, y: 4, width: 390, height: 16, class: 'track' })];
  if (altitude !== null) parts.push(element('rect', { x: 5, y: 4, width: x(altitude) - 5, height: 16, class: 'fill' }));
  const told = [];
  for (const [name, label] of [['handover_altitude_m', 'hand-over'], ['safe_altitude_m', 'safe']]) {
    if (limits[name] === undefined) continue;
    parts.push(element('line', { x1: x(limits[name]), x2: x(limits[name]), y1: 0, y2: 26 }),
      element('text', { x: x(limits[name]), y: 41, 'text-anchor': 'middle' }, `${label} ${limits[name]} m`));
    told.push(`${label} altitude ${limits[name]} m`);
  }
  svg.replaceChildren(...parts);
  text.classList.toggle('hidden', told.length > 0);
  const sentence = told.length ? `Limits: ${told.join(', ')}` : 'The limits are not known: the landing node has not answered';
  if (text.textContent !== sentence) text.textContent = sentence;
}

const LENGTH_S = 600;

export function drawTimeline(svg, samples, cursorS) {
  const x = (seconds) => 1000 * (1 + seconds / LENGTH_S);
  const parts = [];
  let highest = 20;
  for (const each of samples) if (each.altitude_agl_m > highest) highest = each.altitude_agl_m;
  for (let first = 0; first < samples.length;) {
    let last = first;
    while (last + 1 < samples.length && samples[last + 1].state === samples[first].state) last += 1;
    const begin = x(samples[first].time_s), end = x(last + 1 < samples.length ? samples[last + 1].time_s : samples[last].time_s + 0.5);
    parts.push(element('rect', { x: begin, y: 0, width: Math.max(1, end - begin), height: 150,
      class: `band ${LEVELS[samples[first].state] ?? 'none'}` }));
    first = last + 1;
  }
  const line = samples.filter((each) => each.altitude_agl_m !== null)
    .map((each) => `${x(each.time_s).toFixed(1)},${(145 - 135 * each.altitude_agl_m / highest).toFixed(1)}`);
  parts.push(element('polyline', { points: line.join(' '), class: 'alt' }));
  parts.push(element('line', { x1: x(cursorS), x2: x(cursorS), y1: 0, y2: 150, class: 'cursor' }));
  svg.replaceChildren(...parts);
}
