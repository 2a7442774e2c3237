// The clock: which frame is due.
export class Player {
    constructor(capture, show) {
        this.capture = capture;
        this.show = show; // (slot) => true when it is on the screen
        this.slot = 0;
        this.speed = 1;
        this.isLooping = true;
        this.isPlaying = false;
        this.since = 0;
    }

    get last() {
        return Math.max(0, this.capture.slots.length - 1);
    }

    play(isPlaying) {
        this.isPlaying = isPlaying && this.last > 0;
        if (this.isPlaying && !this.isLooping && this.slot === this.last) this.slot = 0;
        this.since = performance.now();
    }

    /** Called before each picture; true where another frame is due. */
    tick(now) {
        if (!this.isPlaying) return false;
        const due = Math.floor(((now - this.since) / 1000) * this.capture.fps * this.speed);
        if (due < 1) return false;
        // A frame that is not decoded yet is waited for, not left out: from it on time is counted anew.
        let next = this.slot + due;
        if (next > this.last) {
            if (!this.isLooping) this.isPlaying = false;
            next = this.isLooping ? next % (this.last + 1) : this.last;
        }
        this.since = Math.max(this.since + (1000 * due) / (this.capture.fps * this.speed), now - 250);
        this.slot = next;
        return true;
    }
}
