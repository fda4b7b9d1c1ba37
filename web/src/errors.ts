import type { Object3D } from "three";

/** Error that says what was asked, what was found, and what to do about it. */
export class TranslucentError extends Error {
  constructor(what: string, found: string, todo: string) {
    super(`${what}; ${found}; ${todo}`);
    this.name = "TranslucentError";
  }
}

/** Name of an object in messages. */
export function nameOf(object: Object3D): string {
  return object.name ? `${object.type} "${object.name}"` : object.type;
}
