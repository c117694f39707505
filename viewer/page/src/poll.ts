// States of a server: each comes when it is another than the one that is known.

/** Rest before the server is asked again after it did not answer, milliseconds. */
export const RETRY_MS = 1000;

/**
 * Takes one state after the other, until `take` says that there are no more. `known` is the number
 * of the state that is known, below 0 of none.
 */
export async function poll<State>(known: () => number, take: (state: State) => boolean): Promise<void> {
  for (let isOn = true; isOn; ) {
    try {
      const answer = await fetch(known() < 0 ? "state" : `state?after=${known()}`);
      if (!answer.ok) throw new Error(answer.statusText);
      isOn = take((await answer.json()) as State);
    } catch {
      await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
    }
  }
}
