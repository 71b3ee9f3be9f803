// SPDX-License-Identifier: MIT
// Unit of the normal force (in the document cN on the left and dN on the right), and its sign.
//
// Only a known mass shows the unit. Without a mass the unit stays assumed.
#include "bringup.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#define POLL_NS     50000000L
#define SAMPLES     40
#define SETTLE_NS   300000000L // Time until the force frames show a new load.
#define G_N_PER_kg  9.8        // Value in the document.
#define MASS_MIN_kg 0.5
#define MASS_MAX_kg 100.0
/// Counts per newton, and the factor by which a hand-held weight may be wrong.
#define CN_PER_N 100.0
#define DN_PER_N 10.0
#define SLACK    2.0
/// A smaller change is noise.
#define COUNTS_MIN 3.0
/// A larger sway, as a share of the change, comes from a hand.
#define SWAY 0.5

/// Raw force during two seconds.
typedef struct {
    double mean;
    long long low;
    long long high;
    bool heard; ///< Almost every poll had a force.
} force_t;

/// Measures the raw force. Ends bringup after a signal.
static force_t read_force(bringup_t *self, iw_side_t side) {
    const unsigned signals = signals_count();
    const struct timespec pause = {0, POLL_NS};
    const struct timespec settle = {0, SETTLE_NS};
    force_t force = {.low = INT16_MAX, .high = INT16_MIN};
    double sum = 0.0;
    int count = 0;
    (void)fputs("  ... measuring for 2 s\n", stdout);
    (void)fflush(stdout);
    (void)nanosleep(&settle, NULL);
    for (int i = 0; i < SAMPLES; i++) {
        json_t *status = trial_status(self);
        const json_t *raw = json_object_get(json_object_get(status, text_side(side)), "force_raw");
        if (json_is_integer(raw)) {
            const long long value = json_integer_value(raw);
            sum += (double)value;
            if (value < force.low) {
                force.low = value;
            }
            if (value > force.high) {
                force.high = value;
            }
            count++;
        }
        json_decref(status);
        (void)nanosleep(&pause, NULL);
    }
    if (signals_count() != signals) {
        bringup_quit(self);
    }
    force.mean = (count > 0) ? sum / count : 0.0;
    force.heard = count >= SAMPLES * 9 / 10;
    return force;
}

/// Returns true if the force swayed little in comparison with the change: then no hand held the handle or the mass.
static bool is_steady(const force_t *force, double change) {
    return (double)(force->high - force->low) <= fmax(COUNTS_MIN * 2.0, fabs(change) * SWAY);
}

static bool is_at_its_end(const force_t *force) {
    return force->low <= INT16_MIN || force->high >= INT16_MAX;
}

static bool is_about(double value, double wanted) {
    return value >= wanted / SLACK && value <= wanted * SLACK;
}

static void keep_unit(bringup_t *self, iw_side_t side, double counts, double mass_kg) {
    const double per_N = fabs(counts) / (mass_kg * G_N_PER_kg);
    const bool cn = is_about(per_N, CN_PER_N);
    const bool dn = is_about(per_N, DN_PER_N);
    const char *word = cn ? "cN" : "dN";
    const iw_force_unit_t before = self->config.core.force_unit[side];
    if (!cn && !dn) {
        talk_print("  %.1f counts per newton fit neither cN (100) nor dN (10): the unit stays assumed. Was the whole "
                   "mass on this handle?",
                   per_N);
        bringup_note(self, text_side(side), "force_unit", NULL, "assumed: %.1f counts per N fit neither cN nor dN",
                     per_N);
        return;
    }
    self->config.core.force_unit[side] = cn ? IW_FORCE_CN : IW_FORCE_DN;
    talk_print("  %.0f counts for %.1f N: the unit is %s%s.%s", fabs(counts), mass_kg * G_N_PER_kg, word,
               (self->config.core.force_unit[side] == before) ? "" : ", which is not the configured one",
               (counts < 0.0) ? " The force counts downwards: pressing is negative." : "");
    bringup_note(self, text_side(side), "force_unit", (side == IW_LEFT) ? "force_unit_left" : "force_unit_right",
                 "%.2f kg changed the raw force by %.0f counts%s", mass_kg, counts,
                 (counts < 0.0) ? "; pressing makes it smaller" : "");
}

/// Reports a measurement without a mass: only whether the handle belongs to this wheel, and its direction of counting.
static void report_press(bringup_t *self, iw_side_t side, double counts) {
    if (fabs(counts) < COUNTS_MIN) {
        talk_print("  Nothing changed on the %s wheel. Is this its handle?", text_side(side));
        bringup_note(self, text_side(side), "force_unit", NULL, "assumed: pressing the handle changed nothing");
        return;
    }
    talk_print("  Pressing changed the raw force by %.0f counts. The unit stays assumed: only a known mass shows it.",
               counts);
    bringup_note(self, text_side(side), "force_unit", NULL, "assumed; pressing changed the raw force by %.0f counts",
                 counts);
}

static void report_deaf(bringup_t *self, iw_side_t side) {
    talk_print("  Force frames of the %s wheel were missing; its unit stays assumed.", text_side(side));
    bringup_note(self, text_side(side), "force_unit", NULL, "assumed: force frames were missing");
}

/// Returns true if the forces are steady and not at the end of their range. Otherwise they do not show the unit; prints
/// the reason.
static bool is_usable(bringup_t *self, iw_side_t side, const force_t *free, const force_t *loaded) {
    if (is_at_its_end(free) || is_at_its_end(loaded)) {
        talk_print("  The raw force is at the end of its range (%lld to %lld); the unit stays assumed. Use less mass.",
                   loaded->low, loaded->high);
        bringup_note(self, text_side(side), "force_unit", NULL, "assumed: the force was at the end of its range");
        return false;
    }
    const double change = loaded->mean - free->mean;
    if (!is_steady(free, change) || !is_steady(loaded, change)) {
        talk_print("  The force swayed (free %lld to %lld, loaded %lld to %lld): was the handle or the mass touched "
                   "meanwhile? The unit stays assumed.",
                   free->low, free->high, loaded->low, loaded->high);
        bringup_note(self, text_side(side), "force_unit", NULL, "assumed: the force swayed while it was weighed");
        return false;
    }
    return true;
}

/// Measures one handle. Returns true if there is no result and the operator wants to try again.
static bool measure(bringup_t *self, iw_side_t side) {
    char question[112];
    char answer[BRINGUP_ANSWER_SIZE];
    double mass_kg = 0.0;
    (void)snprintf(question, sizeof question, "Mass in kg that you will put on the %s handle (Enter: press by hand)",
                   text_side(side));
    const bool weighed = talk_number(self, question, MASS_MIN_kg, MASS_MAX_kg, &mass_kg);
    talk_ask(self, "Remove hands and weights from both handles, then press Enter", "go", answer);
    const force_t free = read_force(self, side);
    if (!free.heard) {
        report_deaf(self, side);
        return false;
    }
    (void)snprintf(question, sizeof question, "Now %s the %s handle, and press Enter while the load stays there",
                   weighed ? "put the mass on" : "press", text_side(side));
    talk_ask(self, question, "go", answer);
    const force_t loaded = read_force(self, side);
    if (!loaded.heard) {
        report_deaf(self, side);
    } else if (!weighed) {
        report_press(self, side, loaded.mean - free.mean);
    } else if (is_usable(self, side, &free, &loaded)) {
        keep_unit(self, side, loaded.mean - free.mean, mass_kg);
    } else {
        return talk_yes(self, "Try again?", true);
    }
    return false;
}

void bringup_force(bringup_t *self) {
    talk_step(7, "the force (nothing turns)");
    talk_print(
        "The wheels' document states cN for the left handle and dN for the right one, ten times as much. A known "
        "mass (a bag of %.1f kg or more) shows the real unit.",
        MASS_MIN_kg);
    trial_start(self, &self->config);
    const bool wanted = talk_yes(self, "Measure the force?", true);
    for (unsigned side = 0; side < IW_SIDES && wanted;) {
        side += measure(self, (iw_side_t)side) ? 0U : 1U;
    }
}
