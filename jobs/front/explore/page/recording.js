// Playback of recorded contacts by the sound engine, with the bodies drawn in sync.

export class Transport {
  /** recording: of the sound engine. elements: {section, play, position, clock}. */
  constructor(recording, player, view, elements) {
    Object.assign(this, { recording, player, view, elements });
    this.isPlaying = false;
    this.from_s = 0;
    elements.section.hidden = false;
    elements.position.max = recording.duration_s.toFixed(2);
    elements.play.addEventListener('click', () => (this.isPlaying ? this.pause() : this.play()));
    elements.position.addEventListener('input', () => {
      const wasPlaying = this.isPlaying;
      this.pause();
      this.from_s = Number(elements.position.value);
      this.show(this.from_s);
      if (wasPlaying) this.play();
    });
    this.show(0);
  }

  async play() {
    await this.player.wake();
    if (this.from_s >= this.recording.duration_s - 0.05) this.from_s = 0;
    this.recording.start({ from_s: this.from_s });
    this.setPlaying(true);
    this.view.move(() => {
      if (!this.isPlaying) return false;
      const now = Math.min(this.recording.duration_s, Math.max(this.from_s, this.recording.time_s));
      this.show(now);
      if (now >= this.recording.duration_s) {
        this.from_s = 0;
        this.setPlaying(false);
      }
      return this.isPlaying;
    });
  }
  pause() {
    if (!this.isPlaying) return;
    this.from_s = this.recording.time_s;
    this.recording.stop();
    this.setPlaying(false);
  }
  setPlaying(isPlaying) {
    this.isPlaying = isPlaying;
    const { play } = this.elements;
    play.setAttribute('aria-pressed', String(isPlaying));
    play.firstElementChild.textContent = isPlaying ? '❚❚' : '▶';
  }

  /** Moves the bodies to their positions at that time. */
  show(time_s) {
    this.player.bodies.forEach((body, i) => {
      const pose = this.recording.pose(i, time_s);
      if (pose) body.shown.setCentrePose(pose.position_m, pose.rotation);
    });
    const { position, clock } = this.elements, text = `${time_s.toFixed(1)} / ${this.recording.duration_s.toFixed(1)} s`;
    position.value = time_s;
    position.setAttribute('aria-valuetext', text);
    clock.textContent = text;
    this.view.draw();
  }
}
