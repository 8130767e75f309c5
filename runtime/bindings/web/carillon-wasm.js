// A module of carillon.wasm and its few imports. Worklets have no TextDecoder, so texts are decoded here.

const kNotThere = 52; // ENOSYS of WASI

/** UTF-8. */
function decode(bytes) {
  let text = '';
  for (let i = 0; i < bytes.length; ) {
    const lead = bytes[i++], more = lead < 0x80 ? 0 : lead < 0xe0 ? 1 : lead < 0xf0 ? 2 : 3;
    let code = more === 0 ? lead : lead & (0x3f >> more);
    for (let k = 0; k < more; ++k) code = (code << 6) | (bytes[i++] & 0x3f);
    text += code <= 0x10ffff ? String.fromCodePoint(code) : '\ufffd';
  }
  return text;
}

/** UTF-8. */
function encode(text) {
  const bytes = [];
  for (const character of text) {
    const code = character.codePointAt(0);
    if (code < 0x80) bytes.push(code);
    else if (code < 0x800) bytes.push(0xc0 | (code >> 6), 0x80 | (code & 0x3f));
    else if (code < 0x10000) bytes.push(0xe0 | (code >> 12), 0x80 | ((code >> 6) & 0x3f), 0x80 | (code & 0x3f));
    else bytes.push(0xf0 | (code >> 18), 0x80 | ((code >> 12) & 0x3f), 0x80 | ((code >> 6) & 0x3f), 0x80 | (code & 0x3f));
  }
  return Uint8Array.from(bytes);
}

/** An error message of the module. */
export class Refusal extends Error {}

export class Wasm {
  /** module: a WebAssembly.Module of carillon.wasm. */
  constructor(module) {
    const imports = {};
    for (const { module: from, name, kind } of WebAssembly.Module.imports(module)) {
      if (kind !== 'function') throw new Error(`carillon.wasm asks for ${from}.${name}; its folder is of another version`);
      imports[from] ??= {};
      imports[from][name] = this.makeImport(from, name);
    }
    this.exports = new WebAssembly.Instance(module, imports).exports;
    this.exports._initialize();
  }

  /** WASI imports: a clock and a root folder; no files, environment or arguments. */
  makeImport(from, name) {
    if (name === 'emscripten_notify_memory_growth') return () => {};
    if (name === 'proc_exit')
      return () => {
        throw new Error('the sound engine has stopped');
      };
    if (name === 'environ_sizes_get')
      return (count, bytes) => {
        const view = new DataView(this.exports.memory.buffer);
        view.setUint32(count, 0, true);
        view.setUint32(bytes, 0, true);
        return 0;
      };
    if (name === 'environ_get') return () => 0;
    if (name === '__syscall_getcwd')
      return (address, size) => {
        if (size < 2) return -kNotThere;
        new Uint8Array(this.exports.memory.buffer).set([0x2f, 0], address >>> 0); // "/": root of relative paths in scenes
        return 2;
      };
    if (name === 'clock_time_get')
      return (...args) => {
        new DataView(this.exports.memory.buffer).setBigUint64(args[args.length - 1], BigInt(Date.now()) * 1000000n, true);
        return 0;
      };
    return from === 'env' ? () => -kNotThere : () => kNotThere;
  }

  /** Calls a function with numbers, texts and typed arrays; texts and arrays are passed by address and length. Throws Refusal with its message. */
  call(name, ...args) {
    const { exports } = this, given = [], taken = [];
    try {
      for (const arg of args) {
        if (typeof arg !== 'string' && !ArrayBuffer.isView(arg)) {
          given.push(arg);
          continue;
        }
        const values = typeof arg === 'string' ? encode(arg) : arg;
        const address = exports.malloc(Math.max(8, values.byteLength)) >>> 0;
        if (address === 0) throw new Refusal('there is not enough memory');
        taken.push(address);
        new Uint8Array(exports.memory.buffer, address, values.byteLength).set(new Uint8Array(values.buffer, values.byteOffset, values.byteLength));
        given.push(address, values.length);
      }
      const result = exports[name](...given);
      if (result === -1) throw new Refusal(this.text());
      return result;
    } finally {
      for (const address of taken) exports.free(address);
    }
  }

  /** The module's last text. */
  text() {
    const { exports } = this;
    return decode(new Uint8Array(exports.memory.buffer, exports.web_text() >>> 0, exports.web_text_size()));
  }
  json() {
    return JSON.parse(this.text());
  }
  /** A copy of the bytes at an address. */
  copy(Type, address, length) {
    return new Type(this.exports.memory.buffer, address >>> 0, length).slice();
  }
  words() {
    return this.copy(Float64Array, this.exports.web_words(), this.exports.web_words_count());
  }
  numbers() {
    return this.copy(Float32Array, this.exports.web_numbers(), this.exports.web_numbers_count());
  }
  bytes() {
    return this.copy(Uint8Array, this.exports.web_bytes(), this.exports.web_bytes_count());
  }
}
