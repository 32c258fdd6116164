# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the small text towers can read: terms with their classes, templates, the tokenizer."""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass
from functools import cache

import numpy as np
from tokenizers import Regex, Tokenizer, normalizers, pre_tokenizers
from tokenizers.models import WordLevel
from tokenizers.processors import TemplateProcessing

from peace_ros.core.domain import Label
from peace_ros.core.prompting import load_vocabularies
from peace_ros.lab.training.arrays import Rng

CONTEXT_LENGTH = 32
PAD, UNKNOWN, START = '[PAD]', '[UNK]', '[CLS]'


def _table(text: str) -> tuple[tuple[frozenset[Label], str], ...]:
    """Read lines of ``LABEL ...: words``; an indented line continues the one before."""
    rows = []
    for line in text.strip().replace('\n  ', ' ').splitlines():
        names, _, words = line.partition(': ')
        rows.append((frozenset(Label[name] for name in names.split()), words))
    return tuple(rows)


TERMS = _table("""
GRASS: grass; dead grass; dry grass; tall grass; short grass; lawn; lawns; green lawn; meadow;
  pasture; turf; garden; gardens; yard; backyard; frontyard; back yard; front yard; courtyard;
  park; park lawn; sports-field; sports field; football field; soccer field; golf course; pitch;
  low vegetation; vegetation; vegetable garden; green space; clover; crop; crops; hay; grassland;
  playground; green field; mown grass
GRASS BARE_GROUND: field; fields; farm field; agricultural land; farmland; open-area; open area;
  open-space; open space; open field; open ground; flat ground; clearing; soft ground; ground;
  landing zone; landing site; safe landing area; safe place to land; empty field; land
BARE_GROUND: bare ground; bare soil; soil; dirt; bare earth; earth; sand; gravel; mud; desert;
  beach; dirt field; ploughed field; plowed field; fallow field; stubble; dust; clay; sandy
  ground; rocky ground; dry ground; dunes
PAVED: road; roads; street; streets; avenue; highway; drive; driveway; lane; sidewalk; pavement;
  parking lot; parking; car park; asphalt; concrete; concrete floor; tarmac; motorway; freeway;
  path; footpath; walkway; crosswalk; zebra crossing; junction; crossroads; roundabout;
  intersection; runway; plaza; square; bridge; road marking; paved ground; paved area; patio;
  stairs; steps; footsteps; bike lane; railway; railroad; train tracks
BUILDING: building; buildings; house; houses; apartment-building; apartment; apartments;
  warehouse; shed; garage; roof; roofs; rooftop; terrace; shelter; dome; canopy; ceiling; hut;
  barn; factory; skyscraper; tower; church; school; villa; home; hangar; greenhouse; tile roof;
  flat roof; office; hall; cabin; structure
TREE: tree; trees; bare tree; tree during autumn; bush; bushes; tall-plant; tall plant; forest;
  woods; wood; shrub; shrubs; hedge; tree canopy; tree crown; palm; palm tree; conifer; pine;
  branches; foliage; orchard; thicket; leafless tree
WATER: water; lake; river; swimming pool; pool; pond; sea; ocean; canal; stream; puddle; fountain;
  water surface; flood; harbour; harbor; bay; wetland; swamp; reservoir
VEHICLE: vehicle; vehicles; car; cars; truck; trucks; train; bus; buses; van; lorry; parked car;
  moving car; motorcycle; motorbike; bicycle; bike; tractor; trailer; caravan; boat; ship;
  traffic; automobile; machine; tram
PERSON: person; people; crowd; pedestrian; pedestrians; human; humans; man; woman; child;
  children; cyclist; someone; worker; group of people; runner; player; animal; dog
OBSTACLE: fence; wall; lamp-post; lamp post; transmission-line; transmission line; power line;
  pole; poles; pylon; container; containers; obstacle; obstacles; antenna; mast; wire; cable;
  bench; rock; rocks; stone; boulder; goal; debris; pipe; barrier; railing; sign; silo; tank;
  street light; crane; scaffold; electric tower; lamp; log; bale
TREE OBSTACLE: hedgerow; vegetation obstacle
PAVED BUILDING TREE WATER VEHICLE PERSON OBSTACLE: hazard; hazards; danger; dangerous area;
  unsafe area; unsafe ground; unsafe place
""")
"""Labels that a term stands for, and the terms, separated by semicolons."""

GROUPS = _table("""
BUILDING: building, house, apartment-building, warehouse, shed, garage
BUILDING: roof, rooftop, terrace, shelter, dome, canopy, ceiling
TREE: tree, bare tree, tree during autumn, bush, tall-plant
WATER: water, lake, river, swimming pool
PERSON: people, crowd
VEHICLE: vehicle, car, train
OBSTACLE: lamp-post, transmission-line
OBSTACLE: fence, wall, hedgerow
PAVED: road, street, avenue, highway, drive, lane
PAVED: stairs, steps, footsteps
GRASS: grass, dead grass, backyard, frontyard, courtyard, lawn
GRASS BARE_GROUND: sports-field, park, open-area, open-space, agricultural land
BARE_GROUND PAVED: parking lot, sidewalk, gravel, dirt, sand, concrete floor, asphalt
""")
"""The groups of the DOVESEI system: each is one prompt."""

CONDITION_WORDS = asdict(load_vocabularies())
"""Category (resolution, frame, environment) -> the words of the package for it."""
EXTRA_WORDS = (
    'good bad blurry sharp clear noisy photo photograph foggy rain snow day daylight dusk dawn '
    'shade shadow shadows graphics aerial satellite drone top high low altitude hazy misty mist '
    'haze wet dry overcast gloomy noise grainy realistic real synthetic simulated simulation '
    'frame camera video quality resolution weather season a an the of in from above at on and or '
    'with is this some small big large many near next to color colour green brown grey gray white '
    'black red blue yellow dirty clean empty'
)
"""Further words that texts may hold."""

TEMPLATES = (
    'A photo of {term}.',
    "A bird's eye view of a {term}, in game screenshot, bad graphics, shade, shadows.",
    'A {resolution} {frame} of {term} in {environment}.',
    '{term}',
    'an aerial image of {term}',
    'a drone photo of the {term} from above',
)
_TEMPLATE_CHANCES = (0.15, 0.15, 0.4, 0.2, 0.05, 0.05)
_NOT_WORD = '[^a-z0-9]+'


def words_of(text: str) -> list[str]:
    """Split as the tokenizer does: lower-case runs of letters and digits."""
    return [word for word in re.split(_NOT_WORD, text.lower()) if word]


def vocabulary() -> tuple[str, ...]:
    """Return every known token, special ones first; its order is the order of the ids."""
    texts = [terms for _, terms in TERMS + GROUPS]
    texts += [EXTRA_WORDS, *(word for words in CONDITION_WORDS.values() for word in words)]
    texts += [re.sub(r'\{\w+\}', ' ', template) for template in TEMPLATES]
    known = sorted({word for text in texts for word in words_of(text)})
    return (PAD, UNKNOWN, START, *known)


@cache
def build_tokenizer() -> Tokenizer:
    """Return the word-level tokenizer: lower-case, punctuation dropped, padded to the longest."""
    ids = {word: index for index, word in enumerate(vocabulary())}
    tokenizer = Tokenizer(WordLevel(ids, unk_token=UNKNOWN))
    tokenizer.normalizer = normalizers.Sequence(
        [normalizers.NFKD(), normalizers.StripAccents(), normalizers.Lowercase()]
    )
    tokenizer.pre_tokenizer = pre_tokenizers.Split(Regex(_NOT_WORD), 'removed')
    tokenizer.post_processor = TemplateProcessing(
        single=f'{START} $A', special_tokens=[(START, ids[START])]
    )
    tokenizer.enable_truncation(CONTEXT_LENGTH)
    tokenizer.enable_padding(pad_id=ids[PAD], pad_token=PAD)
    return tokenizer


@dataclass(frozen=True)
class TermPrompt:
    """A training prompt with what it should select."""

    text: str
    labels: frozenset[Label]
    """Empty when the words name nothing that is known."""


_SINGLE = tuple(
    (term.strip(), labels, group)
    for group, (labels, terms) in enumerate(TERMS)
    for term in terms.split(';')
)
_BY_GROUP = tuple(
    tuple(term for term, _, owner in _SINGLE if owner == group) for group in range(len(TERMS))
)
_GROUP_CHANCES = np.array([2.2, 1.6, 1.6, 1.8, 1.5, 1.5, 1.3, 1.3, 1.3, 1.3, 0.3, 0.6])
_GROUP_CHANCES = _GROUP_CHANCES / _GROUP_CHANCES.sum()


def _pick(rng: Rng, words: tuple[str, ...]) -> str:
    return words[int(rng.integers(len(words)))]


def sample_term(rng: Rng) -> TermPrompt:
    """Draw a term: one word, several of one meaning, a released group, a mixture or nonsense."""
    kind = rng.random()
    if kind < 0.2:
        labels, text = GROUPS[int(rng.integers(len(GROUPS)))]
        return TermPrompt(text, labels)
    group = int(rng.choice(len(TERMS), p=_GROUP_CHANCES))
    labels, first = TERMS[group][0], _BY_GROUP[group]
    if kind < 0.68:
        # The first word of a group is the most frequent one in prompts.
        return TermPrompt(first[0] if rng.random() < 0.25 else _pick(rng, first), labels)
    if kind < 0.84:
        count = min(len(first), int(rng.integers(2, 6)))
        chosen = rng.choice(len(first), size=count, replace=False)
        return TermPrompt(', '.join(first[int(i)] for i in chosen), labels)
    if kind < 0.97:
        other = int(rng.choice(len(TERMS), p=_GROUP_CHANCES))
        text = f'{_pick(rng, first)}, {_pick(rng, _BY_GROUP[other])}'
        return TermPrompt(text, labels | TERMS[other][0])
    return TermPrompt(' '.join(['qqqq'] * int(rng.integers(1, 3))), frozenset())


def sample_prompt(
    rng: Rng, condition_words: tuple[tuple[str, ...], ...] | None = None
) -> TermPrompt:
    """Draw a full prompt.

    ``condition_words`` holds the true resolution, frame and environment words of the image; they
    fill the slots in four of five prompts, random ones in the rest.
    """
    term = sample_term(rng)
    template = TEMPLATES[int(rng.choice(len(TEMPLATES), p=_TEMPLATE_CHANCES))]
    slots: dict[str, str] = {}
    for index, (name, words) in enumerate(CONDITION_WORDS.items()):
        true = condition_words[index] if condition_words is not None else ()
        slots[name] = _pick(rng, true if true and rng.random() < 0.8 else words)
    return TermPrompt(template.format(term=term.text, **slots), term.labels)
