import assert from "node:assert/strict";
import { afterEach, beforeEach, mock, test } from "node:test";
import { PictureLoader, type Target } from "../src/topics/pictureloader.ts";

const files = Array.from({ length: 100 }, (_, index) => new Blob([`${index}`]));
let kept: Map<string, Blob>;

beforeEach(() => {
  kept = new Map();
  let created = 0;
  mock.method(URL, "createObjectURL", (file: Blob) => {
    created += 1;
    kept.set(`blob:${created}`, file);
    return `blob:${created}`;
  });
  mock.method(URL, "revokeObjectURL", (url: string) => kept.delete(url));
});

afterEach(() => mock.restoreAll());

function image(): Target & { done(): void } {
  return {
    src: "",
    hidden: true,
    onload: null,
    onerror: null,
    done() {
      (this.onload as () => void)();
    },
  };
}

test("a slow browser shows the first and the newest picture and keeps no other", () => {
  const target = image();
  const loader = new PictureLoader(target);
  for (const file of files) loader.show(file);
  assert.equal(kept.size, 1);
  assert.equal(kept.get(target.src), files[0]);
  target.done();
  assert.equal(kept.get(target.src), files.at(-1));
  // The first one is still visible.
  assert.equal(kept.size, 2);
  target.done();
  assert.deepEqual([...kept.values()], [files.at(-1)]);
});

test("a picture that cannot be decoded does not stop the next ones", () => {
  const target = image();
  const loader = new PictureLoader(target);
  loader.show(files[0]!);
  (target.onerror as () => void)();
  loader.show(files[1]!);
  target.done();
  assert.deepEqual([...kept.values()], [files[1]]);
});

test("nothing is kept after it is closed while a picture is decoded", () => {
  const target = image();
  const loader = new PictureLoader(target);
  loader.show(files[0]!);
  target.done();
  loader.show(files[1]!);
  loader.show(files[2]!);
  loader.close();
  assert.equal(kept.size, 0);
});
