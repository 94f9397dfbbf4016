// The search takes questions: "How do I change the gains?" asks for "change gain", which finds
// every word that begins so.
(() => {
  const LEFT_OUT = new Set(
    (
      "a an and any are as at be by can could do does for from had has have how i if in into is it " +
      "its me my need needs not of on or one our should so than that the their them then there " +
      "these they this those to up us was we were what when where which who whose why will with " +
      "would you your"
    ).split(" "),
  );
  /** The number of a query among the messages to the search. */
  const QUERY = 2;

  const kept = (question) => {
    // The search leaves out a word behind a dash, and splits names at underscores only in pages.
    const parts = question.replace(/[?!]|(?<!\w)-+|(?<=\w\w)_(?=\w\w)/g, " ");
    const words = parts.split(/\s+/).filter(Boolean);
    const telling = words.filter((word) => !LEFT_OUT.has(word.toLowerCase()));
    const asked = telling.length > 0 ? telling : words;
    return asked.map((word) => word.replace(/(?<=\w\w[^s\W])s$/, "")).join(" ");
  };
  const send = Worker.prototype.postMessage;
  Worker.prototype.postMessage = function (message, ...rest) {
    const isQuery = message?.type === QUERY && typeof message.data === "string";
    send.call(this, isQuery ? { ...message, data: kept(message.data) } : message, ...rest);
  };
})();
