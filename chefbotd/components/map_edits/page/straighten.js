// By which angle a map is turned so that its walls lie along the edges of the view: the sum of the squares of how many occupied
// cells each row and each column has is then the greatest. Lines of cells have flat peaks: the middle of the peak counts.

const OCCUPIED = 65;
const MOST_POINTS = 4000;
const COARSE_DEG = 0.5;
const FINE_DEG = 0.1;
const AROUND_DEG = 2;
const SHARE = 0.5; // of the peak's height, from which on an angle counts

export function findAngle(cells, { columns, rows, heading_rad }) {
  const walls = [];
  cells.forEach((percent, index) => { if (percent >= OCCUPIED) walls.push([index % columns, Math.floor(index / columns)]); });
  if (!walls.length) return 0;
  const every = Math.ceil(walls.length / MOST_POINTS);
  const points = walls.filter((_, index) => index % every === 0);
  const worth = (degrees) => worthOf(points, radians(degrees), columns + rows);
  const coarse = angles(-45, 45, COARSE_DEG);
  const worths = coarse.map(worth);
  let best = coarse[worths.indexOf(Math.max(...worths))];
  for (let round = 0; round < 2; round += 1) best = middleOfPeak(angles(best - AROUND_DEG, best + AROUND_DEG, FINE_DEG), worth);
  // The cells are turned by the grid's heading already; a quarter more shows the same walls.
  const quarter = Math.PI / 2;
  const angle = radians(best) - heading_rad;
  return angle - quarter * Math.round(angle / quarter);
}

function middleOfPeak(degrees, worth) {
  const worths = degrees.map(worth);
  const [least, most] = [Math.min(...worths), Math.max(...worths)];
  const weights = worths.map((one) => Math.max(one - least - SHARE * (most - least), 0));
  const sum = weights.reduce((one, other) => one + other);
  return sum ? degrees.reduce((total, one, index) => total + one * weights[index], 0) / sum : degrees[worths.indexOf(most)];
}

function angles(first, last, step) {
  return Array.from({ length: Math.round((last - first) / step) }, (_, index) => first + index * step);
}

function worthOf(points, angle, size) {
  const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
  const counts = [new Uint32Array(2 * size), new Uint32Array(2 * size)];
  for (const [x, y] of points) {
    counts[0][Math.round(cos * x - sin * y) + size] += 1;
    counts[1][Math.round(sin * x + cos * y) + size] += 1;
  }
  let sum = 0;
  for (const line of counts) for (const count of line) sum += count * count;
  return sum;
}

const radians = (degrees) => (degrees * Math.PI) / 180;
