// What the programs do: their groups, a sentence and a picture each; users' own behaviors come with a sentence.

const SVG = "http://www.w3.org/2000/svg";
const ring = (count, radius, [x, y] = [20, 12]) =>
  Array.from({ length: count }, (_, at) => [x + radius * Math.sin((2 * Math.PI * at) / count), y - radius * Math.cos((2 * Math.PI * at) / count)]);

const CROWD = [[17, 9], [21, 8], [24, 11], [22, 15], [18, 14], [20, 11.5]];
const SPREAD = [[6, 5], [20, 4], [34, 6], [8, 18], [21, 20], [33, 18]];
const ROW = [[7, 12], [14, 12], [21, 12], [28, 12]];
const IN = "M6 4l6 4M34 4l-6 4M6 20l6-4M34 20l-6-4";
const BOX = "M22 7h10v10h-10z";

/** By program: group, sentence, robots at [x, y] and lines in a picture of 40 x 24. */
const ABOUT = {
  swarm_go_to: ["drive", "Robots drive to places of a circle, line or grid around the point that you click.", ring(8, 9)],
  go_to_goal: ["drive", "Each robot waits for goals: \"Go to goal\" and a click on the map.", [[8, 16]], "M10 15l18-8M25 6.5h4v4"],
  random_walk: ["drive", "Robots drive straight and turn away from what their sensors see.", [[30, 8]], "M5 18l8-12 9 13 7-10"],
  follow: ["drive", "The others follow the first robot in a chain; drive it yourself.", ROW, "M31 12h5M34 10l2.5 2-2.5 2"],
  led_show: ["lights", "Lights run through the robots; no robot moves.", ROW, "M7 6v-3M14 6v-3M21 6v-3M28 6v-3"],
  behavior_aggregation: ["gather, spread", "Robots gather by one bit: whether there is a robot ahead.", CROWD, IN],
  behavior_evolved_aggregation: ["gather, spread", "Robots gather by evolved wheel speeds.", CROWD, IN],
  behavior_rendezvous: ["gather, spread", "Robots meet: each drives to the mean place of its neighbors.", CROWD, IN],
  behavior_dispersal: ["gather, spread", "Robots keep away from each other by one bit.", SPREAD],
  behavior_dispersion: ["gather, spread", "Robots push each other away to a spacing.", SPREAD],
  behavior_coverage: ["gather, spread", "Robots share the area evenly.", SPREAD, "M13 0v24M27 0v24M0 12h40"],
  behavior_segregation: ["gather, spread", "Groups come together and keep apart from each other.", [...ring(3, 3, [10, 12]), ...ring(3, 3, [30, 12])], "M20 2v20"],
  behavior_potential_segregation: ["gather, spread", "Groups take distances inside and between them.", [...ring(3, 3, [10, 12]), ...ring(3, 3, [30, 12])], "M20 2v20"],
  behavior_random_fields: ["gather, spread", "Groups move together, by velocities drawn at random.", [...ring(3, 3, [10, 12]), ...ring(3, 3, [30, 12])], "M20 2v20M34 12h4"],
  behavior_molecules: ["gather, spread", "Robots bind each other to patterns, such as water.", [[10, 8], [16, 14], [22, 8], [28, 18], [34, 12]], "M10 8l6 6 6-6M28 18l6-6"],
  behavior_flocking: ["move together", "Robots drive together in one direction.", [[8, 8], [8, 16], [15, 12], [16, 5], [16, 19]], "M22 12h12M31 9l4 3-4 3"],
  behavior_cyclic_pursuit: ["move together", "Robots follow each other on one ring.", ring(6, 9), "M20 3a9 9 0 0 1 8 5M20 21a9 9 0 0 1-8-5"],
  behavior_milling: ["move together", "Robots circle a common center, like fish.", [...ring(6, 9), ...ring(3, 4)]],
  behavior_wall_following: ["move together", "Robots follow the walls.", [[8, 5], [20, 5], [35, 12]], "M3 1.5h35v21"],
  behavior_leader_followers: ["move together", "Robot 0 drives a circle; each follows the one before it.", ROW, "M31 12h5"],
  behavior_formation: ["move together", "Robots take the distances of a regular polygon.", ring(5, 9), "M20 3l8.6 6.2-3.3 10.1h-10.6l-3.3-10.1z"],
  behavior_object_clustering: ["push objects", "Robots gather objects.", [[8, 6], [9, 18]], "M20 8h5v5h-5zM26 12h5v5h-5z"],
  behavior_box_pushing: ["push objects", "Robots line up behind a box and push it to the goal.", [[18, 8], [18, 12], [18, 16]], `${BOX}M34 12h4`],
  behavior_cooperative_transport: ["push objects", "Robots push where the object hides the goal.", [[18, 7], [19, 17], [22, 20]], `${BOX}M34 12h4`],
  behavior_voter: ["decide", "Robots agree on a color: each takes that of a neighbor.", ring(6, 8), "M20 4l-7 4M27 8v8"],
  behavior_majority: ["decide", "Robots agree on a color: each takes that of most neighbors.", ring(6, 8), "M13 8l14 8M20 4v16"],
};

/** Name of the group in which the program is listed. */
export const groupOf = ({ program, sentence }) => ABOUT[program]?.[0] ?? (sentence ? "your own" : "others");

export const sentenceOf = ({ program, sentence }) => ABOUT[program]?.[1] ?? sentence;

/** A drawing of the program's robots; null for those that have none. */
export function makePicture({ program }) {
  if (!(program in ABOUT)) return null;
  const [, , robots, lines = ""] = ABOUT[program];
  const picture = document.createElementNS(SVG, "svg");
  picture.setAttribute("viewBox", "0 0 40 24");
  picture.setAttribute("aria-hidden", "true");
  const dot = ([x, y]) => `M${x - 1.9} ${y}a1.9 1.9 0 1 0 3.8 0a1.9 1.9 0 1 0-3.8 0`;
  for (const [name, path] of [["lines", lines], ["dots", robots.map(dot).join("")]]) {
    const drawn = document.createElementNS(SVG, "path");
    drawn.setAttribute("class", name);
    drawn.setAttribute("d", path);
    picture.append(drawn);
  }
  return picture;
}
