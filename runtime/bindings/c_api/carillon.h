/* C interface of Carillon, also for other languages and compilers: a scene of ringing bodies, rendered block by block.
 *
 * Every structure begins with its own size: set it with the *_init macro, and programs built against this header continue to work with
 * later libraries, which add fields at the end only. (Other languages call the *_init_sized function with the size of the structure as they
 * know it.) Functions that can fail return a status, and write a message of at most message_size bytes, zero included, when `message` is
 * not NULL; their output is then NULL and nothing has changed. Pointers must not be NULL unless stated; NULL gives
 * CARILLON_BAD_ARGUMENT.
 *
 * Threads: [main] one thread at a time; [audio] one thread at a time, never waits, allocates or makes a system call; [any] any thread
 * at any time, never waits. Units are SI; vectors x y z. */
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

/* Incremented with every added function or field. The number in the name of libcarillon.so.3 differs: it changes only when
 * programs must be recompiled. */
#define CARILLON_ABI_VERSION 11

/* ABI version of the library. */
CARILLON_API uint32_t carillon_abi_version(void);

typedef enum carillon_status {
  CARILLON_OK = 0,
  CARILLON_BAD_ARGUMENT = 1, /* NULL, or a structure that was not initialised */
  CARILLON_BAD_INPUT = 2,    /* a file, a number or an event that cannot be played */
  CARILLON_FULL = 3,         /* no room: raise a limit of carillon_options, or wait */
  CARILLON_SYSTEM = 4        /* the disk or the memory failed */
} carillon_status;

/* "ok", "bad argument", ... [any] */
CARILLON_API const char* carillon_status_text(carillon_status status);

typedef struct carillon_bank carillon_bank;
typedef struct carillon_model carillon_model;
typedef struct carillon_synth carillon_synth;

/* ---- Banks, as written by carillon-precompute. [any], not on an audio thread. */

typedef enum carillon_frequencies {
  CARILLON_FREQUENCIES_CORRECTED = 0, /* with the estimated mesh error removed; uncorrected if the bank has none */
  CARILLON_FREQUENCIES_MESH = 1       /* frequencies of the mesh */
} carillon_frequencies;

/* Reads a bank, with its corrected frequencies. Files are untrusted: a damaged one gives CARILLON_BAD_INPUT. */
CARILLON_API carillon_status carillon_bank_open(const char* file, carillon_bank** bank, char* message, size_t message_size);
/* The same from memory, which may be freed afterwards. */
CARILLON_API carillon_status carillon_bank_parse(const void* bytes, size_t size, carillon_bank** bank, char* message, size_t message_size);
/* Both with a choice of carillon_frequencies. Modes are in ascending order of them. */
CARILLON_API carillon_status carillon_bank_open_as(const char* file, int32_t frequencies, carillon_bank** bank, char* message,
                                                   size_t message_size);
CARILLON_API carillon_status carillon_bank_parse_as(const void* bytes, size_t size, int32_t frequencies, carillon_bank** bank,
                                                    char* message, size_t message_size);
/* NULL is allowed. Models made from the bank remain valid. */
CARILLON_API void carillon_bank_close(carillon_bank* bank);
CARILLON_API int32_t carillon_bank_mode_count(const carillon_bank* bank);
CARILLON_API int32_t carillon_bank_triangle_count(const carillon_bank* bank);
/* The undamped frequency [Hz] of a mode, 0 for an unknown mode. */
CARILLON_API double carillon_bank_frequency_hz(const carillon_bank* bank, int32_t mode);

/* The surface, in the frame of the body's mesh, as used by strikes. Valid until the bank is closed. NULL for a
 * NULL bank. */
CARILLON_API int32_t carillon_bank_vertex_count(const carillon_bank* bank);
/* x y z [m] per vertex: 3 * carillon_bank_vertex_count numbers. */
CARILLON_API const double* carillon_bank_vertices_m(const carillon_bank* bank);
/* Three vertices per triangle, counter-clockwise from outside: 3 * carillon_bank_triangle_count indices, starting
 * at 0. */
CARILLON_API const int32_t* carillon_bank_triangles(const carillon_bank* bank);
/* The centre of mass in that frame; carillon_motion gives its position in the world. Zeros for a NULL bank. */
CARILLON_API void carillon_bank_centre_m(const carillon_bank* bank, double centre_m[3]);
/* Data for rigid-body physics. `inertia_kg_m2` is about the centre of mass, row by row, in the axes of the mesh. For a body of several
 * materials, or an anisotropic one, the moduli are those of its isotropic equivalent, and the density is mass
 * over volume. Unknown values are 0: bodies with known modes may have no volume. */
typedef struct carillon_body_facts {
  uint32_t size;
  uint32_t reserved;
  double mass_kg;
  double volume_m3;
  double inertia_kg_m2[9];
  double density_kg_m3;
  double young_modulus_pa;
  double poisson_ratio;
} carillon_body_facts;

#define carillon_body_facts_init(facts) carillon_body_facts_init_sized((facts), sizeof(carillon_body_facts))
CARILLON_API void carillon_body_facts_init_sized(carillon_body_facts* facts, size_t size);
/* `facts->size` must be set. */
CARILLON_API carillon_status carillon_bank_get_facts(const carillon_bank* bank, carillon_body_facts* facts);
/* The surface point nearest to a point [m], as used by carillon_impulse and carillon_contact: triangle and
 * barycentric coordinates. closest_m, the point itself, and distance_m may be NULL. O(log triangles). [any], several at
 * once; the first call for a bank builds a tree, which allocates and takes 0.2 to 0.5 ms for 1,000 triangles, and others wait for it:
 * call it once before an audio thread does; later calls neither wait nor allocate. CARILLON_BAD_INPUT for a point that is
 * not finite or further than 1e100 m: triangle is then -1. */
CARILLON_API carillon_status carillon_bank_nearest_point(const carillon_bank* bank, const double point_m[3], int32_t* triangle,
                                                         double barycentric[3], double closest_m[3], double* distance_m);

/* Changes density, stiffness, size or damping of a body without a solve. */
typedef struct carillon_edits {
  uint32_t size;
  int32_t sets_damping;   /* not 0: Rayleigh damping of alpha1_s, alpha2_per_s in place of the bank's law */
  double density_scale;   /* 1e-6 to 1e6, as all scales */
  double stiffness_scale; /* of both Lame constants */
  double size_scale;      /* of all lengths */
  double alpha1_s;
  double alpha2_per_s;
} carillon_edits;

/* All scales 1, damping unchanged. */
#define carillon_edits_init(edits) carillon_edits_init_sized((edits), sizeof(carillon_edits))
CARILLON_API void carillon_edits_init_sized(carillon_edits* edits, size_t size);
/* The bank of the edited body. CARILLON_BAD_INPUT for scales out of range, alphas below 0, and bodies of several materials. */
CARILLON_API carillon_status carillon_bank_edit(const carillon_bank* bank, const carillon_edits* edits, carillon_bank** edited,
                                                char* message, size_t message_size);

/* ---- Models: a bank prepared for a sample rate. [any], not on an audio thread. */

typedef enum carillon_radiation {
  CARILLON_RADIATION_SPHERE = 0, /* radiation of an equivalent sphere */
  CARILLON_RADIATION_OSG02 = 1,  /* pulsating sphere: the bank's gains (O'Brien, Shen, Gatchalian 2002) */
  CARILLON_RADIATION_BEM = 2,    /* the bank's multipoles; CARILLON_BAD_INPUT without */
  CARILLON_RADIATION_AUTO = 3    /* CARILLON_RADIATION_BEM for a bank with multipoles, CARILLON_RADIATION_SPHERE for others */
} carillon_radiation;

typedef struct carillon_model_options {
  uint32_t size;
  int32_t radiation; /* carillon_radiation */
  double rate_hz;
} carillon_model_options;

/* 48 kHz, CARILLON_RADIATION_AUTO. */
#define carillon_model_options_init(options) carillon_model_options_init_sized((options), sizeof(carillon_model_options))
CARILLON_API void carillon_model_options_init_sized(carillon_model_options* options, size_t size);
CARILLON_API carillon_status carillon_model_make(const carillon_bank* bank, const carillon_model_options* options, carillon_model** model,
                                                 char* message, size_t message_size);
/* NULL is allowed. Bodies keep the model they play. */
CARILLON_API void carillon_model_release(carillon_model* model);
/* Modes below the Nyquist frequency. */
CARILLON_API int32_t carillon_model_mode_count(const carillon_model* model);

/* ---- The synthesiser. */

typedef struct carillon_options {
  uint32_t size;
  int32_t max_bodies;
  int32_t max_strikes; /* per body, waiting or active */
  int32_t ring_events; /* event capacity between two blocks */
  double rate_hz;
  double longest_m; /* maximum audible distance */
  double listener_m[3];
  const double (*microphones_m)[3]; /* from the listener, axes of the world; NULL: two ears 20 cm apart along x */
  int32_t microphone_count;
  int32_t max_waypoints;     /* stored per body */
  double budget;             /* carillon_set_budget */
  double ground_roughness_m; /* rms height of the ground, for contacts without another body */
  double ground_friction;    /* Coulomb */
  double head_radius_m;  /* of a head in the middle of two microphones, left and right, for CARILLON_HEAD: a rigid sphere with ears, upright
                            (z) unless the listener is rotated; 0.03 to 0.3, of an average head 0.0875; 0: none */
  double floor_height_m; /* z of a rigid floor, for CARILLON_GROUND_REFLECTION; bodies and microphones are above */
  double floor_reflection; /* reflected share of the pressure, 0..1; 0: no floor */
} carillon_options;

/* 48 kHz, two ears, 64 bodies, 64 strikes a body, 4096 events, 60 m, 64 waypoints, unlimited work, smooth concrete, no head, no
 * floor. */
#define carillon_options_init(options) carillon_options_init_sized((options), sizeof(carillon_options))
CARILLON_API void carillon_options_init_sized(carillon_options* options, size_t size);

/* [main] */
CARILLON_API carillon_status carillon_create(const carillon_options* options, carillon_synth** synth, char* message, size_t message_size);
/* [main], no other thread may use it. NULL is allowed. */
CARILLON_API void carillon_destroy(carillon_synth* synth);
/* [main] Adds a body, audible from the next 128 frames on; events use its number. */
CARILLON_API carillon_status carillon_add_body(carillon_synth* synth, const carillon_model* model, const double position_m[3],
                                               int32_t* body, char* message, size_t message_size);

/* Effects of a body, combined as a sum; described in docs/howto/scene-files.md. */
typedef enum carillon_effect {
  CARILLON_MODAL = 1,
  CARILLON_HERTZ_PULSE = 2,
  CARILLON_ROUGHNESS = 4,
  CARILLON_ROLLING = 8,
  CARILLON_CONTACT_DAMPING = 16,
  CARILLON_ACCELERATION_NOISE = 32,
  CARILLON_AIR_DELAY = 64,
  CARILLON_DOPPLER = 128,
  CARILLON_TWO_EARS = 256,
  CARILLON_DIRECTIVITY = 512,        /* needs a bank with multipoles, else CARILLON_BAD_INPUT */
  CARILLON_GROUND_REFLECTION = 1024, /* CARILLON_BAD_INPUT if floor_reflection is 0 */
  CARILLON_HEAD = 2048,              /* with CARILLON_TWO_EARS; CARILLON_BAD_INPUT if head_radius_m is 0 */
  CARILLON_NONLINEAR = 4096,         /* needs a bank with a nonlinear energy, else CARILLON_BAD_INPUT */
  CARILLON_CASCADE = 8192            /* with CARILLON_NONLINEAR; no effect without modes above the coupled ones */
} carillon_effect;
#define CARILLON_EFFECT_COUNT 9       /* the first ones, to CARILLON_TWO_EARS */
#define CARILLON_LATER_EFFECT_COUNT 2 /* the next ones, to CARILLON_GROUND_REFLECTION */

typedef struct carillon_body_options {
  uint32_t size;
  uint32_t effects; /* sum of carillon_effect */
  double position_m[3];
  double rotation[4];    /* of the frame of the mesh: w x y z, unit */
  double longest_m;      /* as in carillon_options; 0: the value there */
  double silence_pa;     /* below this pressure at 1 m a body sleeps */
  int32_t max_waypoints; /* 0: as in carillon_options */
  int32_t reserved;
  double roughness_m; /* rms height of the surface, for CARILLON_ROUGHNESS and CARILLON_ROLLING */
  double friction;    /* Coulomb; contacts use the geometric mean of both bodies */
} carillon_body_options;

/* At the origin, unrotated, fine machined metal, default effects: all available ones except those of lasting contacts, which
   take memory, CARILLON_ACCELERATION_NOISE, and those with requirements on bank or scene. */
#define carillon_body_options_init(options) carillon_body_options_init_sized((options), sizeof(carillon_body_options))
CARILLON_API void carillon_body_options_init_sized(carillon_body_options* options, size_t size);
/* [main] carillon_add_body with all options. */
CARILLON_API carillon_status carillon_add_body_with(carillon_synth* synth, const carillon_model* model,
                                                    const carillon_body_options* options, int32_t* body, char* message,
                                                    size_t message_size);
/* [main] 0 for an unknown body. */
CARILLON_API uint32_t carillon_get_effects(const carillon_synth* synth, int32_t body);
/* [main] The body keeps ringing with another model, usually that of an edited bank: every mode keeps its energy and phase and
 * continues at its new frequency and decay, without a click. The body keeps the model; the old one is freed by
 * carillon_collect. */
CARILLON_API carillon_status carillon_swap_model(carillon_synth* synth, int32_t body, const carillon_model* model, char* message,
                                                 size_t message_size);
/* [main] Silences the body; its number is reusable after carillon_collect. */
CARILLON_API carillon_status carillon_remove_body(carillon_synth* synth, int32_t body);
/* [main] Frees removed bodies; call it regularly. */
CARILLON_API void carillon_collect(carillon_synth* synth);
/* [any] Full scale per pascal; initially 1. */
CARILLON_API void carillon_set_gain(carillon_synth* synth, double per_pa);
/* [any] Limit of the work per second of sound, in mode-samples (modes times samples, as carillon_counters counts them); INFINITY: no limit,
 * the initial value. Above it, the least audible modes of all bodies fade out; no body or strike is dropped. Not a
 * number: 0. */
CARILLON_API void carillon_set_budget(carillon_synth* synth, double mode_samples_per_s);
CARILLON_API double carillon_get_budget(const carillon_synth* synth);
/* [main] Sets the budget so that carillon_process uses this share of one core, 0.01 to 1. Call it about ten times a second with the total
 * time [s] spent in carillon_process by a clock of yours: the library reads none. */
CARILLON_API carillon_status carillon_keep_load(carillon_synth* synth, double share, double busy_s);

/* One contact pulse. Point and impulse are in the frame of the body's mesh. */
typedef struct carillon_impulse {
  uint32_t size;
  int32_t body;
  int32_t triangle; /* of the bank */
  int32_t gaussian; /* 0: sin^1.5 (Hertz); else Gaussian */
  double time_s;    /* middle of the pulse, since the first frame */
  double duration_s;
  double barycentric[3];
  double impulse_n_s[3];
  int32_t other; /* the other body; -1: the ground, or unknown */
  int32_t reserved;
} carillon_impulse;

/* The force of one contact pulse as samples: constant in each of `count` steps of `step_s`. Played exactly. A pulse may be given
 * in one piece or in several, of any length. Point and impulses are in the frame of the body's mesh. */
typedef struct carillon_force {
  uint32_t size;
  int32_t body;
  int32_t triangle;               /* of the bank */
  int32_t other;                  /* the other body; -1: the ground, or unknown */
  double time_s;                  /* start of the first step, since the first frame */
  double step_s;                  /* above 0 */
  const double (*impulse_n_s)[3]; /* on the body, per step */
  int32_t count;                  /* number of steps, at least 1 */
  int32_t continues;              /* not 0: continues the previous pulse */
  double barycentric[3];
} carillon_force;

typedef enum carillon_contact_state {
  CARILLON_CONTACT_BEGIN = 0,
  CARILLON_CONTACT_HOLD = 1,
  CARILLON_CONTACT_END = 2
} carillon_contact_state;

#define CARILLON_BY_MATERIAL (-1.0)

/* State of a lasting contact at one time, as seen by one of its two bodies; the other body gets one too, with the same id. Between two of
 * them all values are interpolated linearly. Vectors are in the frame of the body's mesh. */
typedef struct carillon_contact {
  uint32_t size;
  int32_t state; /* carillon_contact_state */
  uint64_t id;   /* of the contact, constant while it lasts; seeds the profiles of both surfaces: the same id gives the same
                    sound */
  int32_t body;
  int32_t other;    /* the other body; -1: the ground, or unknown */
  int32_t triangle; /* of the bank */
  int32_t reserved;
  double time_s;
  double barycentric[3];
  double normal[3];       /* unit, from the other body into this one */
  double slip_m_s[3];     /* velocity of this surface relative to the other */
  double force_n;         /* normal, at least 0 */
  double sweep_m_s;       /* speed of the contact point over this body's surface; 0 for a box sliding flat */
  double other_sweep_m_s; /* over the other's */
  double spin_rad_s;      /* relative angular speed about the tangents: rolling */
  double patch_radius_m;  /* Hertz radius under force_n */
  double impedance_n_s_m; /* of the other body at the point, as a dashpot; 0: absorbs nothing; CARILLON_BY_MATERIAL, the default: of a
                             plane wave into its material over the patch, rho c pi patch_radius_m^2 */
} carillon_contact;

/* Position of a body: its centre of mass in the world. */
typedef struct carillon_motion {
  uint32_t size;
  int32_t body;
  double time_s;
  double position_m[3];
  double velocity_m_s[3];
  double rotation[4]; /* of the frame of its mesh: w x y z, unit */
  int32_t cut;        /* not 0: the body jumps here from where it was (a teleport), without a path in between */
  int32_t reserved;
} carillon_motion;

/* Position of the listener. */
typedef struct carillon_listener {
  uint32_t size;
  double time_s;
  double position_m[3];
  double velocity_m_s[3];
} carillon_listener;

#define carillon_impulse_init(impulse) carillon_impulse_init_sized((impulse), sizeof(carillon_impulse))
CARILLON_API void carillon_impulse_init_sized(carillon_impulse* impulse, size_t size);
#define carillon_force_init(force) carillon_force_init_sized((force), sizeof(carillon_force))
CARILLON_API void carillon_force_init_sized(carillon_force* force, size_t size);
#define carillon_contact_init(contact) carillon_contact_init_sized((contact), sizeof(carillon_contact))
CARILLON_API void carillon_contact_init_sized(carillon_contact* contact, size_t size);
#define carillon_motion_init(motion) carillon_motion_init_sized((motion), sizeof(carillon_motion))
CARILLON_API void carillon_motion_init_sized(carillon_motion* motion, size_t size);
#define carillon_listener_init(listener) carillon_listener_init_sized((listener), sizeof(carillon_listener))
CARILLON_API void carillon_listener_init_sized(carillon_listener* listener, size_t size);

/* [any], not on an audio thread. Varies a strike like a human player: energy, place, direction and duration.
 * `variation`, 0 to 1, is the amount (docs/howto/scene-files.md); 0 leaves it unchanged, to the bit. The same `seed` and number of the
 * strike give the same variation; scene files use carillon_name_seed of the body's name, and 0 for its first strike. The bank is
 * that of the body; the first call builds the tree of carillon_bank_nearest_point. CARILLON_BAD_INPUT for another variation, a triangle
 * that the bank lacks, and an invalid impulse. */
CARILLON_API carillon_status carillon_vary_impulse(const carillon_bank* bank, double variation, uint64_t seed, uint64_t strike,
                                                   carillon_impulse* impulse);
/* 64-bit FNV-1a of a name; 0 for NULL. [any] */
CARILLON_API uint64_t carillon_name_seed(const char* name);

/* [any] Events, in any order; those before carillon_horizon_s act late. CARILLON_BAD_INPUT for invalid events.
 */
CARILLON_API carillon_status carillon_push_impulse(carillon_synth* synth, const carillon_impulse* impulse);
/* A force of more than 16 steps occupies several slots of the ring and of the body's strikes, which has twice max_strikes for forces;
 * CARILLON_FULL if the ring has no room for all of it; the part that fits is played. */
CARILLON_API carillon_status carillon_push_force(carillon_synth* synth, const carillon_force* force);
CARILLON_API carillon_status carillon_push_contact(carillon_synth* synth, const carillon_contact* contact);
CARILLON_API carillon_status carillon_push_motion(carillon_synth* synth, const carillon_motion* motion);
CARILLON_API carillon_status carillon_push_listener(carillon_synth* synth, const carillon_listener* listener);

/* [any] Physics is complete up to this time: no earlier events follow. Optional; contacts are then held until this time, and overruns of
 * the sound are counted (carillon_counters.underruns). */
CARILLON_API carillon_status carillon_push_mark(carillon_synth* synth, double time_s);

/* [audio] Renders the next frames: out[c] receives `frames` samples for each of `channels` channels, the microphones' first. Does nothing
 * if synth or out is NULL or a count is not positive. */
CARILLON_API void carillon_process(carillon_synth* synth, float* const* out, int32_t channels, int32_t frames);

/* [any] Time of the next frame, and the earliest time at which an event is not late. */
CARILLON_API double carillon_time_s(const carillon_synth* synth);
CARILLON_API double carillon_horizon_s(const carillon_synth* synth);

typedef struct carillon_counters {
  uint32_t size;
  uint32_t reserved;
  int64_t strikes;              /* played */
  int64_t refused;              /* unknown body or triangle, or no room */
  int64_t late;                 /* strikes moved to the horizon */
  int64_t faults;               /* invalid events */
  int64_t overflows;            /* events lost because the ring was full */
  int64_t resets;               /* bodies silenced because their state was not finite */
  int64_t mode_samples;         /* work: modes times samples */
  int64_t faded;                /* groups of 16 modes faded out to meet the budget */
  int64_t underruns;            /* number of times the sound overtook the last carillon_push_mark */
  int64_t zeroed;               /* output samples that were not finite and were set to 0 */
  int64_t contacts_accepted;    /* carillon_contacts played */
  int64_t contacts_refused;     /* unknown triangle */
  int64_t contacts_dropped;     /* weaker than the eight contacts played per body */
  int64_t contacts_thinned;     /* replaced their predecessor for lack of room */
  int64_t contacts_without_use; /* for a body without CARILLON_ROUGHNESS, CARILLON_ROLLING and CARILLON_CONTACT_DAMPING */
} carillon_counters;

#define carillon_counters_init(counters) carillon_counters_init_sized((counters), sizeof(carillon_counters))
CARILLON_API void carillon_counters_init_sized(carillon_counters* counters, size_t size);
/* [any] `counters->size` must be set. */
CARILLON_API carillon_status carillon_get_counters(const carillon_synth* synth, carillon_counters* counters);

/* Work of one body's effects, in the order of carillon_effect. */
typedef struct carillon_effect_counters {
  uint32_t size;
  uint32_t reserved;
  int64_t units[CARILLON_EFFECT_COUNT];             /* modal: mode-samples; hertz_pulse: pulses; the others: samples */
  int64_t later_units[CARILLON_LATER_EFFECT_COUNT]; /* directivity: transfers looked up; ground_reflection: samples */
  int64_t head_units;                               /* samples */
  int64_t nonlinear_units;                          /* coupled modes times samples */
  int64_t cascade_units;                            /* modes above the coupled ones times samples */
} carillon_effect_counters;

#define carillon_effect_counters_init(counters) carillon_effect_counters_init_sized((counters), sizeof(carillon_effect_counters))
CARILLON_API void carillon_effect_counters_init_sized(carillon_effect_counters* counters, size_t size);
/* [any] `counters->size` must be set. Zeros for an unknown body. */
CARILLON_API carillon_status carillon_get_effect_counters(const carillon_synth* synth, int32_t body, carillon_effect_counters* counters);
/* [any] Largest pressure of its modes so far [Pa at 1 m]; 0 for an unknown body. */
CARILLON_API double carillon_peak_pa(const carillon_synth* synth, int32_t body);
/* [any] Largest modal deflection so far, in thicknesses (twice the volume over the surface). 0 up to half a thickness, the range of
 * linear modes; for banks with a nonlinear energy, strings and membranes; and for an unknown body. */
CARILLON_API double carillon_deflection(const carillon_synth* synth, int32_t body);

/* ---- Sensors on bodies (docs/howto/robot-hearing.md) ---- */

typedef enum carillon_quantity {
  CARILLON_ACCELERATION = 0, /* m/s2 */
  CARILLON_VELOCITY = 1,     /* m/s */
  CARILLON_DISPLACEMENT = 2, /* m */
  CARILLON_STRAIN = 3        /* 1 */
} carillon_quantity;

/* Place and direction are in the frame of the body's mesh. */
typedef struct carillon_sensor {
  uint32_t size;
  int32_t body;
  int32_t triangle; /* of the bank */
  int32_t quantity; /* carillon_quantity */
  double barycentric[3];
  double direction[3]; /* any length; CARILLON_STRAIN: axis of the gauge, projected onto the surface */
  double rate_hz;      /* of its samples, 50 to 192000; 0: that of the sound */
  double buffer_s;     /* samples that wait for carillon_read_sensor; more are lost and counted */
  int32_t held;        /* not 0: the body does not move as a rigid body */
  int32_t reserved;
} carillon_sensor;

/* An accelerometer along z in the middle of triangle 0 of body 0, at the rate of the sound, with a buffer of 1 s. */
#define carillon_sensor_init(sensor) carillon_sensor_init_sized((sensor), sizeof(carillon_sensor))
CARILLON_API void carillon_sensor_init_sized(carillon_sensor* sensor, size_t size);
/* [main] Adds a sensor, which reads from the next 128 frames on. `bank`: that of the body's model; not kept. CARILLON_BAD_INPUT for an
 * unknown body or triangle, a body without CARILLON_MODAL, the acceleration of one with CARILLON_NONLINEAR, a direction without length,
 * and a rate out of range. A body with sensors refuses carillon_swap_model. Sensors end with their body: what is left is to be read
 * before the next carillon_add_sensor, which may take their numbers. */
CARILLON_API carillon_status carillon_add_sensor(carillon_synth* synth, const carillon_bank* bank, const carillon_sensor* sensor,
                                                 int32_t* number, char* message, size_t message_size);
/* [any], one thread per sensor. The next readings in SI units, as many as carillon_process has made; returns their number, 0 for an unknown
 * sensor. Sample n is the reading at carillon_sensor_begin_s + n / rate_hz, without delay. */
CARILLON_API int32_t carillon_read_sensor(carillon_synth* synth, int32_t number, double* out, int32_t samples);
/* [any] Time of the first sample; 0 for a sensor that was added before the first frame. */
CARILLON_API double carillon_sensor_begin_s(const carillon_synth* synth, int32_t number);
/* [any] Samples lost because the buffer was full. */
CARILLON_API int64_t carillon_sensor_lost(const carillon_synth* synth, int32_t number);

/* ---- Touches: steps of a physics engine to impulses, forces, contacts, motions and marks
 * (docs/howto/my-engine.md). [main] all of it: one thread at a time per carillon_touches; it allocates. Its events go to the synthesiser
 * as by carillon_push_*. Vectors are in world axes. */
typedef struct carillon_touches carillon_touches;

typedef enum carillon_event_kind {
  CARILLON_EVENT_MARK = 0,    /* event: double, as of carillon_push_mark */
  CARILLON_EVENT_IMPULSE = 1, /* carillon_impulse */
  CARILLON_EVENT_FORCE = 2,   /* carillon_force */
  CARILLON_EVENT_CONTACT = 3, /* carillon_contact */
  CARILLON_EVENT_MOTION = 4   /* carillon_motion */
} carillon_event_kind;

typedef struct carillon_touches_options {
  uint32_t size;
  int32_t max_points;   /* per step; of more the weakest are left out and counted */
  int32_t points_after; /* 0: points are of the poses before the step (Bullet, MuJoCo, PhysX, Jolt); 1: of those after it (Simbody) */
  int32_t compliant;    /* not 0: a hit lasts many steps (Simbody, MuJoCo): it ends when its force has decayed */
  int32_t early;        /* not 0: hits are reported when they begin, with the impulse predicted from the restitution */
  int32_t max_impacts;  /* limit of the work for impacts with modes: that of so many at once, and of 20 times as many per second. Further
                           hits are Hertz pulses limited in energy, counted as `simplified` */
  double gravity_m_s2[3];
  double slowest_m_s;     /* slower approaches are no hits; 0: 1 mm/s, or half of gravity times the step if that is more */
  double longest_hit_s;   /* hits that last longer are ended, and counted as `cut` */
  double ground_young_pa; /* of body -1; concrete */
  double ground_poisson;
  double ground_density_kg_m3;
  double ground_restitution;
  double ground_friction;
  /* NULL: to the synthesiser. Called within carillon_touches_start, _step and _remove; the event is valid during the call. */
  void (*sink)(void* user, int32_t kind, const void* event);
  void* user;
} carillon_touches_options;

/* 4096 points of the poses before the step, 8 impacts, gravity 9.81 along -z, hits of at most 60 ms, a floor of concrete. */
#define carillon_touches_options_init(options) carillon_touches_options_init_sized((options), sizeof(carillon_touches_options))
CARILLON_API void carillon_touches_options_init_sized(carillon_touches_options* options, size_t size);

typedef struct carillon_touches_body {
  uint32_t size;
  int32_t body;  /* number in the synthesiser; -1: silent, but strikes others */
  int32_t fixed; /* not 0: static, or moved by the program: infinite mass */
  int32_t reserved;
  const carillon_bank* bank; /* surface, inertia, moduli, modes; must outlive the carillon_touches. NULL: only for silent bodies */
  uint64_t name_seed;        /* carillon_name_seed of a name: contacts sound the same whatever other bodies there are */
  double mass_kg;            /* 0, as of all others up to size_m: that of the bank. The engine's, where it differs */
  double inertia_kg_m2[9];   /* about the centre of mass, mesh axes; all 0: of the bank, without bank that of a ball of size_m */
  double young_pa;
  double poisson;
  double density_kg_m3;
  double size_m;      /* diagonal of the bounding box */
  double restitution; /* a contact uses the geometric mean of both bodies */
  double friction;    /* likewise */
} carillon_touches_body;

/* Restitution 0.5, friction 0.4, all others of the bank. */
#define carillon_touches_body_init(body) carillon_touches_body_init_sized((body), sizeof(carillon_touches_body))
CARILLON_API void carillon_touches_body_init_sized(carillon_touches_body* body, size_t size);

#define CARILLON_ASLEEP 1u     /* the engine has put the body to sleep: it rests until this is gone */
#define CARILLON_TELEPORTED 2u /* moved by the program in this step: its contacts end, its path is cut */
#define CARILLON_JOINTED 4u    /* on joints: its effective mass is measured from the step */

/* Motion of a body at the end of a step; its centre of mass. This layout never changes. */
typedef struct carillon_pose {
  double position_m[3];
  double rotation[4]; /* of the frame of its mesh: w x y z, unit to 1e-3 */
  double velocity_m_s[3];
  double spin_rad_s[3]; /* world axes */
  uint32_t flags;       /* sum of CARILLON_ASLEEP, ... */
  uint32_t reserved;
} carillon_pose;

/* A contact point of a step. This layout never changes. Given the pose that `points_after` names. */
typedef struct carillon_point {
  int32_t a, b;           /* indices of carillon_touches_add; b may be -1: the ground */
  double point_m[3];      /* on b */
  double normal[3];       /* unit, from b into a */
  double gap_m;           /* negative: overlap; on a the point is point_m + gap_m * normal */
  double impulse_n_s;     /* on a along the normal, sum of the whole step; NAN: found from the change of velocities */
  double friction_n_s[3]; /* on a, across the normal; NAN: found likewise */
  double curvature_per_m; /* of both surfaces together; NAN: from the shapes of the banks */
  uint64_t reserved;      /* 0; contacts are recognised by their positions, not by ids of the engine */
} carillon_point;

/* `synth`: may be NULL if options give a sink; must outlive the carillon_touches. */
CARILLON_API carillon_status carillon_touches_create(carillon_synth* synth, const carillon_touches_options* options,
                                                     carillon_touches** touches, char* message, size_t message_size);
/* NULL is allowed. */
CARILLON_API void carillon_touches_destroy(carillon_touches* touches);
/* Adds a body; `index` is its place in `poses` from the next step on: the lowest one that is free. CARILLON_BAD_INPUT for an open surface,
 * and a silent body without mass, modulus or size. */
CARILLON_API carillon_status carillon_touches_add(carillon_touches* touches, const carillon_touches_body* body, int32_t* index,
                                                  char* message, size_t message_size);
/* Ends the contacts of the body; its pose is ignored from now on. */
CARILLON_API carillon_status carillon_touches_remove(carillon_touches* touches, int32_t index);
/* Time and poses before the first step; again after a break, such as a loaded game. `bodies`: the highest index plus 1. */
CARILLON_API carillon_status carillon_touches_start(carillon_touches* touches, double time_s, const carillon_pose* poses, int32_t bodies,
                                                    char* message, size_t message_size);
/* A step of the engine from the time before to time_s, of any length. CARILLON_BAD_INPUT for time that does not advance, poses that are not
 * finite, and a wrong number of bodies: nothing has changed. Points with numbers that cannot be used are left out and counted.
 * CARILLON_FULL if the ring has no room: the events are kept and come first at the next step. `points` may be NULL if count is 0. */
CARILLON_API carillon_status carillon_touches_step(carillon_touches* touches, double time_s, const carillon_pose* poses, int32_t bodies,
                                                   const carillon_point* points, int32_t count, char* message, size_t message_size);
/* [any] No earlier events follow. The sound must stay this far behind the physics: its time below carillon_touches_mark_s. */
CARILLON_API double carillon_touches_mark_s(const carillon_touches* touches);

typedef struct carillon_touches_counters {
  uint32_t size;
  uint32_t reserved;
  int64_t steps;
  int64_t points;         /* accepted */
  int64_t bad_points;     /* left out: not finite, normal not unit, unknown bodies */
  int64_t dropped_points; /* left out: more than max_points */
  int64_t hits;           /* pulses and impacts that were sounded */
  int64_t impacts;        /* of them integrated with modes */
  int64_t simplified;     /* beyond the work of max_impacts: limited Hertz pulses */
  int64_t limited;        /* pulses reduced to the energy of the blow */
  int64_t masked;         /* hits left out: inaudible next to others */
  int64_t weights;        /* impulses that were load only */
  int64_t settled;        /* pulses of lasting contacts taken for load */
  int64_t cut;            /* hits ended by longest_hit_s */
  int64_t touches;        /* lasting contacts begun */
  int64_t records;        /* carillon_contacts */
  int64_t teleports;
  int64_t waiting;      /* events kept because the ring was full, now */
  int64_t lost;         /* events dropped: more than a million were waiting, or numbers were out of range */
  double longest_hit_s; /* so far */
} carillon_touches_counters;

#define carillon_touches_counters_init(counters) carillon_touches_counters_init_sized((counters), sizeof(carillon_touches_counters))
CARILLON_API void carillon_touches_counters_init_sized(carillon_touches_counters* counters, size_t size);
/* [main] `counters->size` must be set. */
CARILLON_API carillon_status carillon_touches_get_counters(const carillon_touches* touches, carillon_touches_counters* counters);

#ifdef __cplusplus
}
#endif

#endif /* CARILLON_H */
