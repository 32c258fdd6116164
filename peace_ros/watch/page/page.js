// Copyright 2026 The peace_ros authors
// SPDX-License-Identifier: Apache-2.0
// Takes what the watch node sends and shows it. All ages are counted by the node, from receipt, so
// a browser whose clock is wrong or that slept shows nothing old as new.

import { LEVELS, drawAltitude, drawCameraMarks, drawMap, drawTimeline, words } from './drawings.js';

const $ = (id) => document.getElementById(id);
const KEPT_S = 600, SAMPLE_S = 0.5, EVENTS = 200, LOST_S = 1.5;
// Words are new with every message; what is drawn of many points, less often: phones are slow.
const DRAW_S = 0.25;
const SYMBOLS = { good: '\u2713', active: '\u25CF', warn: '!', bad: '\u2715', none: '\u25CB' };
const ARROWS = { LANDING: '\u25BC', CLIMBING: '\u25B2' };

let token = new URLSearchParams(location.hash.slice(1)).get('token') ?? sessionStorage.getItem('token') ?? '';
if (token) sessionStorage.setItem('token', token);
// Not in the history, not in a screenshot.
if (location.hash) history.replaceState(null, '', location.pathname);

let state = null, marks = [], ground = null, samples = [], events = [], heardAt = 0, drawnAt = 0, retryMs = 250;
const pictures = {};

function say(id, text) {
  const target = $(id);
  if (target.textContent !== text) target.textContent = text;
}
const metres = (value, digits = 1) => (value === null || value === undefined ? '-' : `${value.toFixed(digits)} m`);
const seconds = (value) => (value === null || value === undefined ? 'never' : `${value < 10 ? value.toFixed(1) : value.toFixed(0)} s`);
const clock = (s) => `${Math.floor(s / 60)}:${String(Math.floor(s % 60)).padStart(2, '0')}`;
const nowS = () => performance.now() / 1000;

function connect() {
  const socket = new WebSocket(`${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/live`);
  socket.binaryType = 'arraybuffer';
  socket.onmessage = ({ data }) => {
    heardAt = nowS();
    retryMs = 250;
    if (typeof data === 'string') take(JSON.parse(data));
    else takePicture(data);
  };
  socket.onclose = (event) => {
    say('link', event.reason || 'no connection to peace watch: trying again');
    $('link').dataset.good = 'no';
    setTimeout(connect, retryMs);
    retryMs = Math.min(5000, 2 * retryMs);
  };
}

function take(message) {
  const at = nowS();
  if (message.history) {
    let reason = '';
    samples = message.history.samples.map((each) => {
      reason = each.reason ?? reason;
      return { ...each, reason, at: at + each.time_s };
    });
    events = message.history.events.map((each) => ({ ...each, at: at + each.time_s }));
    return;
  }
  state = message.state;
  events.push(...message.events.map((each) => ({ ...each, at: at + each.time_s })));
  events = events.filter((each) => at - each.at < KEPT_S).slice(-EVENTS);
  if (!state.silent && (!samples.length || at - samples.at(-1).at >= SAMPLE_S || samples.at(-1).state !== state.state)) {
    samples.push({ ...state, at });
  }
  samples = samples.filter((each) => at - each.at < KEPT_S);
  show();
  document.body.dataset.updates = String(Number(document.body.dataset.updates ?? 0) + 1);
}

async function takePicture(buffer) {
  const length = new DataView(buffer).getUint32(0);
  const meta = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const kind = meta.kind === 'overlay' ? 'image/jpeg' : 'image/png';
  const url = URL.createObjectURL(new Blob([new Uint8Array(buffer, 4 + length)], { type: kind }));
  const picture = new Image();
  picture.src = url;
  try { await picture.decode(); } catch { URL.revokeObjectURL(url); return; }
  const old = pictures[meta.kind];
  pictures[meta.kind] = { url, at: nowS() - meta.age_s };
  if (meta.kind === 'overlay') {
    $('overlay').src = url;
    $('overlay').hidden = false;
    $('camera').style.aspectRatio = `${picture.naturalWidth} / ${picture.naturalHeight}`;
    marks = meta.marks;
    if (state) drawCameraMarks($('camera-marks'), $('camera-caption'), marks, state);
  } else {
    ground = { ...meta, url };
  }
  if (old) setTimeout(() => URL.revokeObjectURL(old.url), 1000);
}

function show() {
  say('vehicle', state.vehicle === '/' ? '' : state.vehicle);
  say('link', `connected${state.others.length ? `; other vehicles here: ${state.others.join(', ')}` : ''}`);
  $('link').dataset.good = 'yes';
  document.body.classList.toggle('old', state.silent);
  $('problem').hidden = !state.problem;
  say('problem', state.problem.replace(/^./, (first) => first.toUpperCase()));
  const level = state.silent ? 'bad' : LEVELS[state.state] ?? 'none';
  document.body.dataset.level = level;
  say('symbol', (!state.silent && ARROWS[state.state]) || SYMBOLS[level]);
  say('state', state.state || 'UNKNOWN');
  say('since', state.time_in_state_s === null ? '' : `for ${clock(state.time_in_state_s)}`);
  say('brief', `${state.state || 'UNKNOWN'}${state.altitude_agl_m === null ? '' : `, ${metres(state.altitude_agl_m, 0)}`}`);
  say('words', state.words);
  say('reason', state.reason);
  announce();
  say('where', state.site ? words(state.site, 'site').replace('Site: ', '') : `nowhere yet: ${state.verdict_reason || 'no place is known'}`);
  say('stops', state.stops);
  const nearest = nearer();
  say('nearer', nearest ? words(nearest, 'refused').replace('Refused, ', '') : state.site ? 'no nearer place is refused' : 'no place is known');
  const stops = [...state.guard, ...(state.in_control === 'false' && LEVELS[state.state] === 'active' ? ['the autopilot does not follow us'] : [])];
  say('guard', stops.join('; ') || (['warn', 'bad'].includes(level) ? `the state ${state.state}` : 'nothing'));
  say('altitude', state.altitude_agl_m === null ? '-' : state.altitude_agl_m.toFixed(1));
  drawAltitude($('altitude-bar'), $('altitude-text'), state);
  showSpeeds();
  showPlaces();
  showPrompt();
  showFindings();
  showAges();
  if (nowS() - drawnAt >= DRAW_S) {
    drawnAt = nowS();
    drawMap($('map'), $('map-caption'), state, samples, ground);
    showPast();
  }
  for (const [id, possible] of [['engage', true], ['disengage', true]]) $(id).disabled = !token || state.silent || !possible;
  if (!token) say('answer', 'Commands need the address with its token that peace watch has printed.');
}

// For a screen reader: the state, or the problem, when its words change; not every second.
let announced = '';
function announce() {
  const sentence = state.problem || `${state.state}: ${state.words}. ${state.reason}`;
  const key = (state.problem || state.state).replace(/[\d.]+/g, '');
  if (key !== announced) say('announce', sentence);
  announced = key;
}

// The nearest refused place, and with a site only one that is nearer than the site.
function nearer() {
  const limit = state.site?.distance_m ?? Infinity;
  return state.refused.filter((each) => each.distance_m < limit)
    .reduce((best, each) => (best === null || each.distance_m < best.distance_m ? each : best), null);
}

function showSpeeds() {
  const { limits } = state;
  const high = state.altitude_agl_m !== null && state.altitude_agl_m >= (limits.safe_altitude_m ?? 0);
  const sideways = limits[high ? 'lateral_speed_limit' : 'landing_lateral_speed_limit'];
  const of = (limit) => (limit === undefined ? '' : `, at most ${limit} m/s`);
  say('lateral', state.v_north_m_s === null ? '-' : `commanded ${Math.hypot(state.v_north_m_s, state.v_east_m_s).toFixed(1)} m/s${of(sideways)}`);
  const down = state.v_down_m_s;
  const vertical = down > 0 ? `${down.toFixed(1)} m/s down${of(limits.z_speed_landing)}` : `${(-down || 0).toFixed(1)} m/s up${of(limits.z_speed_climbing)}`;
  say('vertical', down === null ? '-' : `commanded ${down === 0 ? '0.0 m/s: holds its height' : vertical}`);
  const control = { true: 'follows us', false: 'does not follow us', unknown: 'control not known' }[state.in_control] ?? '';
  const armed = { true: 'armed', false: 'disarmed' }[state.armed] ?? '';
  say('autopilot', [state.mode, armed, control, state.status_text, state.line_warning].filter(Boolean).join(', ') || '-');
  say('ages', `telemetry ${seconds(state.telemetry_age_s)} old, map ${seconds(state.map_age_s)} old`);
}

function showPlaces() {
  const list = $('refused');
  const lines = state.refused.map((each) => `${each.distance_m.toFixed(0)} m away: ${each.reason}`);
  while (list.children.length > lines.length) list.lastChild.remove();
  lines.forEach((line, index) => {
    const item = list.children[index] ?? list.appendChild(document.createElement('li'));
    if (item.textContent !== line) item.textContent = line;
  });
  say('verdict', lines.length ? '' : `None within 60 m. ${state.verdict === 'NO_ZONE' ? `No site: ${state.verdict_reason}.` : ''}`);
}

function showPrompt() {
  if (!state.prompt) return;
  say('prompt-age', `${seconds(state.prompt_age_s)} old`);
  say('template', state.prompt.template.replace('{term}', '\u2026'));
  const key = JSON.stringify(state.prompt.words);
  if ($('scores').dataset.key === key) return;
  $('scores').dataset.key = key;
  $('scores').replaceChildren(...Object.entries(state.prompt.words).map(([category, ranking]) => {
    const block = document.createElement('div');
    block.className = 'category';
    const title = document.createElement('h3');
    title.textContent = category;
    block.append(title);
    for (const { word, score } of ranking.slice(0, 3)) {
      const meter = document.createElement('meter');
      Object.assign(meter, { min: 0, max: 1, value: score });
      meter.setAttribute('aria-label', `${word}: ${score.toFixed(2)}`);
      const name = document.createElement('span'), value = document.createElement('span');
      name.textContent = word;
      value.textContent = score.toFixed(2);
      block.append(name, meter, value);
    }
    return block;
  }));
}

function showFindings() {
  const body = $('findings');
  while (body.rows.length > state.findings.length) body.deleteRow(-1);
  state.findings.forEach((each, index) => {
    const row = body.rows[index] ?? body.insertRow();
    while (row.cells.length < 4) row.insertCell().className = row.cells.length === 2 ? 'is' : '';
    const level = ['', 'Warning: ', 'Error: ', 'Silent: '][each.level] ?? '';
    const cells = [each.name, level + each.sentence, each.rate_hz, each.latency_s && `${Number(each.latency_s).toFixed(2)} s`];
    cells.forEach((text, column) => { if (row.cells[column].textContent !== text) row.cells[column].textContent = text; });
    row.dataset.level = each.level;
  });
}

function showAges() {
  for (const kind of ['overlay', 'ground']) say(`${kind}-age`, pictures[kind] ? `${seconds(nowS() - pictures[kind].at)} old` : '');
}

function showPast() {
  const at = nowS(), back = Number($('back').value);
  const relative = samples.map((each) => ({ ...each, time_s: each.at - at }));
  drawTimeline($('timeline'), relative, back);
  const then = relative.filter((each) => each.time_s <= back).at(-1);
  const text = back === 0 ? 'now' : then
    ? `${clock(-back)} ago: ${then.state}, ${metres(then.altitude_agl_m)}, ${then.reason}` : `${clock(-back)} ago: nothing was heard`;
  say('then', text);
  $('back').setAttribute('aria-valuetext', text);
  const list = $('events');
  if (list.dataset.key !== `${events.length} ${events.at(-1)?.at}`) {
    list.dataset.key = `${events.length} ${events.at(-1)?.at}`;
    list.replaceChildren(...events.toReversed().map((each) => {
      const item = document.createElement('li'), time = document.createElement('time');
      time.dataset.at = each.at;
      item.append(time, `${each.kind}: ${each.sentence}`);
      return item;
    }));
  }
  for (const time of list.querySelectorAll('time')) {
    const text = `-${clock(at - Number(time.dataset.at))}`;
    if (time.textContent !== text) time.textContent = text;
  }
}

async function post(path, body) {
  const answer = await fetch(path, {
    method: 'POST', body: JSON.stringify(body),
    headers: { 'Content-Type': 'application/json', Authorization: `Bearer ${token}` },
  });
  return answer.json();
}

// Two steps: a ticket first, then a question with what is known now, then the command.
async function ask(action) {
  const prepared = await post('/command/prepare', { action }).catch(() => ({ sentence: 'no connection' }));
  if (!prepared.ticket) { say('answer', `Refused: ${prepared.sentence}`); return; }
  const engaging = action === 'engage';
  say('ask-title', engaging ? 'Engage the landing?' : 'Disengage the landing?');
  say('ask-text', engaging
    ? `The autopilot will be asked to obey, and the vehicle flies to a place that this computer chooses. Now: ${state.state}, ${metres(state.altitude_agl_m)}, ${state.verdict_reason}.`
    : 'The vehicle stops and is asked to hold its place. Nothing is commanded afterwards.');
  say('ask-yes', engaging ? 'Yes, engage' : 'Yes, disengage');
  const dialog = $('ask');
  const close = setTimeout(() => { dialog.close(); say('answer', 'Not confirmed within 10 s: nothing was done.'); }, 1000 * prepared.valid_s);
  $('ask-no').onclick = () => { clearTimeout(close); dialog.close(); say('answer', 'Cancelled: nothing was done.'); };
  $('ask-yes').onclick = async () => {
    clearTimeout(close);
    dialog.close();
    say('answer', 'Asking the landing node...');
    const answer = await post('/command/confirm', { ticket: prepared.ticket }).catch(() => ({ sentence: 'no connection' }));
    say('answer', `${answer.done ? 'Done' : 'Refused'}: ${answer.sentence}`);
  };
  dialog.oncancel = () => clearTimeout(close);
  dialog.showModal();
  $('ask-no').focus();
}

for (const action of ['engage', 'disengage']) $(action).addEventListener('click', () => ask(action));
$('back').addEventListener('input', () => { if (state) showPast(); });
// The node sends at least twice per second: after a longer silence what is shown is old.
setInterval(() => {
  if (!heardAt || nowS() - heardAt < LOST_S) return;
  document.body.classList.add('old');
  document.body.dataset.level = 'bad';
  $('problem').hidden = false;
  say('problem', `No connection to peace watch for ${Math.round(nowS() - heardAt)} s: what is shown is old`);
  for (const id of ['engage', 'disengage']) $(id).disabled = true;
}, 500);
connect();
