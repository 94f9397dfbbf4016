// Suggestions for names that are not understood.

/** Most names in a suggestion. */
const MOST = 3;

/** Changed letters of a name, as a share of its length, up to which another name resembles it. */
const RESEMBLES = 0.34;

/** Returns a hint at names that resemble an unknown one, or end like it; empty: none do. */
export function didYouMean(name: string, known: Iterable<string>): string {
  const wanted = letters(name);
  const rated = [...known].map((other) => {
    // A name may lack its component.
    const own = letters(other);
    const last = letters(other.slice(other.indexOf(".") + 1));
    const changes = Math.min(distance(wanted, own), distance(wanted, last));
    return { other, changes };
  });
  const near = rated
    .filter(({ changes }) => changes <= RESEMBLES * wanted.length)
    .sort((a, b) => a.changes - b.changes);
  const best = near.filter(({ changes }) => changes === near[0].changes).slice(0, MOST);
  return best.length ? `; did you mean ${best.map(({ other }) => other).join(" or ")}?` : "";
}

function letters(name: string): string {
  return name.toLowerCase().replace(/[^a-z0-9]/g, "");
}

/** Returns the number of letters to add, drop or change that takes one text to another. */
function distance(a: string, b: string): number {
  let row = Array.from({ length: b.length + 1 }, (_, k) => k);
  for (let i = 1; i <= a.length; i++) {
    const next = [i];
    for (let k = 1; k <= b.length; k++) {
      const same = row[k - 1] + (a[i - 1] === b[k - 1] ? 0 : 1);
      next.push(Math.min(same, row[k] + 1, next[k - 1] + 1));
    }
    row = next;
  }
  return row[b.length];
}
