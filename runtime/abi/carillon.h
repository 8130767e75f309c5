/* Carillon for programs in C, and for those of other languages and compilers: a scene of bodies that ring, played block by block.
 *
 * Every structure begins with its own size: set it with the *_init function, and programs built against this header go on working with later
 * libraries. Functions that can fail return a status, and write a message of at most message_size bytes, zero included, when `message` is not
 * NULL; what they were to make is then NULL and nothing has changed. Pointers must not be NULL unless it says so; NULL gives
 * CARILLON_BAD_ARGUMENT.
 *
 * Threads: [main] one thread at a time; [audio] one thread at a time, never waits, takes no memory, makes no system call; [any] any thread at
 * any time, never waits. Units are SI; vectors x y z. */
#ifndef CARILLON_H
#define CARILLON_H

#include <stddef.h>
#include <stdint.h>

#if defined(__GNUC__)
#define CARILLON_API __attribute__((visibility("default")))
#else
#define CARILLON_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define CARILLON_ABI_VERSION 1

/* That of the library. */
CARILLON_API uint32_t carillon_abi_version(void);

typedef enum carillon_status {
  CARILLON_OK = 0,
  CARILLON_BAD_ARGUMENT = 1, /* NULL, or a structure that was not initialised */
  CARILLON_BAD_INPUT = 2,    /* a file, a number or an event that cannot be played */
  CARILLON_FULL = 3,         /* no room: raise a limit of carillon_options, or wait */
  CARILLON_SYSTEM = 4        /* the disk or the memory failed */
} carillon_status;

typedef struct carillon_bank carillon_bank;
typedef struct carillon_model carillon_model;
typedef struct carillon_synth carillon_synth;

/* ---- Banks: what carillon-precompute writes. [any], not on an audio thread. */

/* Reads a bank. Files are untrusted: a damaged one gives CARILLON_BAD_INPUT. */
CARILLON_API carillon_status carillon_bank_open(const char* file, carillon_bank** bank, char* message, size_t message_size);
/* The same from memory, which is not needed afterwards. */
CARILLON_API carillon_status carillon_bank_parse(const void* bytes, size_t size, carillon_bank** bank, char* message, size_t message_size);
/* NULL is allowed. Models that were made of the bank stay. */
CARILLON_API void carillon_bank_close(carillon_bank* bank);
CARILLON_API int32_t carillon_bank_mode_count(const carillon_bank* bank);
CARILLON_API int32_t carillon_bank_triangle_count(const carillon_bank* bank);
/* The undamped frequency [Hz] of a mode, 0 when there is no such mode. */
CARILLON_API double carillon_bank_frequency_hz(const carillon_bank* bank, int32_t mode);

/* ---- Models: a bank made ready for a sample rate. [any], not on an audio thread. */

typedef enum carillon_radiation {
  CARILLON_RADIATION_SPHERE = 0, /* spherical multipoles of the body's surface */
  CARILLON_RADIATION_OSG02 = 1   /* the bank's own gains (O'Brien, Shen, Gatchalian 2002) */
} carillon_radiation;

typedef struct carillon_model_options {
  uint32_t size;
  int32_t radiation; /* carillon_radiation */
  double rate_hz;
} carillon_model_options;

/* 48 kHz, CARILLON_RADIATION_SPHERE. */
CARILLON_API void carillon_model_options_init(carillon_model_options* options);
CARILLON_API carillon_status carillon_model_make(const carillon_bank* bank, const carillon_model_options* options, carillon_model** model,
                                                 char* message, size_t message_size);
/* NULL is allowed. Bodies that play the model keep it. */
CARILLON_API void carillon_model_release(carillon_model* model);
/* Modes below the Nyquist frequency. */
CARILLON_API int32_t carillon_model_mode_count(const carillon_model* model);

/* ---- The synthesiser. */

typedef struct carillon_options {
  uint32_t size;
  int32_t max_bodies;
  int32_t max_strikes; /* that a body may have waiting or acting at once */
  int32_t ring_events; /* that may wait between two blocks */
  double rate_hz;
  double longest_m; /* bodies further away are not heard */
  double listener_m[3];
  const double (*microphones_m)[3]; /* from the listener, axes of the world; NULL: two ears 20 cm apart along x */
  int32_t microphone_count;
} carillon_options;

/* 48 kHz, two ears, 64 bodies, 64 strikes a body, 4096 events, 60 m. */
CARILLON_API void carillon_options_init(carillon_options* options);

/* [main] */
CARILLON_API carillon_status carillon_create(const carillon_options* options, carillon_synth** synth, char* message, size_t message_size);
/* [main], once no other thread uses it. NULL is allowed. */
CARILLON_API void carillon_destroy(carillon_synth* synth);
/* [main] A new body at a place, heard from the next 128 frames on; its number, which events name. */
CARILLON_API carillon_status carillon_add_body(carillon_synth* synth, const carillon_model* model, const double position_m[3], int32_t* body,
                                               char* message, size_t message_size);
/* [main] It falls silent; its number is free once carillon_collect has given its memory back. */
CARILLON_API carillon_status carillon_remove_body(carillon_synth* synth, int32_t body);
/* [main] Gives back the memory of removed bodies; call it now and then. */
CARILLON_API void carillon_collect(carillon_synth* synth);
/* [any] Full scale per pascal; 1 at first. */
CARILLON_API void carillon_set_gain(carillon_synth* synth, double per_pa);

/* One contact pulse. Point and impulse are in the frame of the body's mesh. */
typedef struct carillon_impulse {
  uint32_t size;
  int32_t body;
  int32_t triangle; /* of the bank */
  int32_t gaussian; /* 0: sin^1.5 (Hertz); else Gaussian */
  double time_s;    /* the middle of the pulse, since the first frame */
  double duration_s;
  double barycentric[3];
  double impulse_n_s[3];
} carillon_impulse;

/* Where a body is: its centre of mass in the world. */
typedef struct carillon_motion {
  uint32_t size;
  int32_t body;
  double time_s;
  double position_m[3];
  double velocity_m_s[3];
} carillon_motion;

/* Where the listener is. */
typedef struct carillon_listener {
  uint32_t size;
  double time_s;
  double position_m[3];
  double velocity_m_s[3];
} carillon_listener;

CARILLON_API void carillon_impulse_init(carillon_impulse* impulse);
CARILLON_API void carillon_motion_init(carillon_motion* motion);
CARILLON_API void carillon_listener_init(carillon_listener* listener);

/* [any] Events, in any order; those before carillon_horizon_s act late. CARILLON_BAD_INPUT for numbers that are not finite, and the like. */
CARILLON_API carillon_status carillon_push_impulse(carillon_synth* synth, const carillon_impulse* impulse);
CARILLON_API carillon_status carillon_push_motion(carillon_synth* synth, const carillon_motion* motion);
CARILLON_API carillon_status carillon_push_listener(carillon_synth* synth, const carillon_listener* listener);

/* [audio] The next frames: out[c] takes `frames` numbers for each of `channels` channels, the first ones the microphones'. Nothing happens
 * when synth or out is NULL or a count is not positive. */
CARILLON_API void carillon_process(carillon_synth* synth, float* const* out, int32_t channels, int32_t frames);

/* [any] Time of the next frame, and the time from which on events are in time. */
CARILLON_API double carillon_time_s(const carillon_synth* synth);
CARILLON_API double carillon_horizon_s(const carillon_synth* synth);

typedef struct carillon_counters {
  uint32_t size;
  uint32_t reserved;
  int64_t strikes;      /* played */
  int64_t refused;      /* for a body or a place on it that is not there, or without room */
  int64_t late;         /* strikes moved to the horizon */
  int64_t faults;       /* events that cannot be played */
  int64_t overflows;    /* events for which the ring had no room */
  int64_t resets;       /* bodies silenced because their state was no number */
  int64_t mode_samples; /* work: modes times samples */
} carillon_counters;

/* [any] `counters->size` must be set. */
CARILLON_API carillon_status carillon_get_counters(const carillon_synth* synth, carillon_counters* counters);

#ifdef __cplusplus
}
#endif

#endif /* CARILLON_H */
