// Browsers start no worker for a page that was opened from a disk, and the search is one. There a frame that nobody
// sees runs the worker's program: what it posts comes here, and what is posted to it goes in as a message. Each side
// gets copies, as with a worker: the search takes the query that it is sent to pieces.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(address) {
      super();
      this.onmessage = null;
      this.waiting = [];
      this.frame = document.createElement("iframe");
      this.frame.hidden = true;
      document.body.append(this.frame);
      const inside = this.frame.contentWindow;
      inside.postMessage = (data) => this.tell(data);
      const program = inside.document.createElement("script");
      program.src = address;
      program.onload = () => {
        const waiting = this.waiting;
        this.waiting = null;
        waiting.forEach((event) => this.frame.contentWindow?.dispatchEvent(event));
      };
      program.onerror = () => this.dispatchEvent(new ErrorEvent("error"));
      inside.document.body.append(program);
    }

    tell(data) {
      const event = new MessageEvent("message", { data: structuredClone(data) });
      setTimeout(() => {
        this.dispatchEvent(event);
        if (this.onmessage) this.onmessage(event);
      });
    }

    postMessage(data) {
      const event = new MessageEvent("message", { data: structuredClone(data) });
      if (this.waiting) this.waiting.push(event);
      else setTimeout(() => this.frame.contentWindow?.dispatchEvent(event));
    }

    terminate() {
      this.frame.remove();
    }
  };
}
