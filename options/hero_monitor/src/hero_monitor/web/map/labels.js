// Places names beside robots so that none covers another, or another robot.

const GAP_PX = 3;

/** Corners of a label beside a robot: below, above, right, left. */
function* listPlaces({ x, y, radius, width, height }) {
  yield [x - width / 2, y + radius + GAP_PX];
  yield [x - width / 2, y - radius - GAP_PX - height];
  yield [x + radius + GAP_PX, y - height / 2];
  yield [x - radius - GAP_PX - width, y - height / 2];
}

const overlap = (one, other) =>
  one[0] < other[0] + other[2] && other[0] < one[0] + one[2] && one[1] < other[1] + other[3] && other[1] < one[1] + one[3];

/**
 * Return for each label its upper left corner, or null where there is no room for it.
 * labels: {x, y, radius, width, height, isNeeded} in px; those that are needed come first.
 * boxes: [left, top, width, height] of what no label may be behind.
 */
export function placeLabels(labels, boxes) {
  const bodies = labels.map(({ x, y, radius }) => [x - radius, y - radius, 2 * radius, 2 * radius]);
  const taken = [...boxes];
  const corners = labels.map(() => null);
  const order = [...labels.keys()].sort((one, other) => labels[other].isNeeded - labels[one].isNeeded);
  for (const index of order) {
    const { width, height, isNeeded } = labels[index];
    const places = [...listPlaces(labels[index])];
    const isFree = (place) => {
      const box = [...place, width, height];
      return !taken.some((other) => overlap(box, other)) && !bodies.some((body, at) => at !== index && overlap(box, body));
    };
    const place = places.find(isFree) || (isNeeded ? places[0] : null);
    if (!place) continue;
    corners[index] = place;
    taken.push([...place, width, height]);
  }
  return corners;
}
