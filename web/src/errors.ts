/** Error that says what was asked, what was found, and what to do about it. */
export class TranslucentError extends Error {
  constructor(what: string, found: string, todo: string) {
    super(`${what}; ${found}; ${todo}`);
    this.name = "TranslucentError";
  }
}
