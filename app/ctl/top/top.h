// SPDX-License-Identifier: MIT
/// The live screen of `top`: what is drawn from the last snapshot, on whatever terminal there is.
///
/// 80 x 24 show everything, with the state in letters that can be read across a room. Smaller terminals lose what is least
/// needed first, and narrow ones have shorter lines; below 20 x 4 there is only the state. Larger ones have room for the last
/// minute. Texts of other programs are cleaned before they are drawn.
#ifndef TOP_H
#define TOP_H

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>

#define TOP_TEXT_SIZE 512U

typedef enum { TOP_PLAIN = 0, TOP_TITLE, TOP_GOOD, TOP_CARE, TOP_BAD, TOP_FAINT, TOP_TONES } top_tone_t;

/// Speed left and right, force left and right.
#define TOP_PLOTS      4
#define TOP_HISTORY_US 100000
#define TOP_HISTORY    600

/// The last minute, one value each 100 ms; the newest is at `slot % TOP_HISTORY`. Begins as zeros.
typedef struct {
    int64_t slot;
    int32_t value[TOP_PLOTS][TOP_HISTORY]; ///< INT32_MIN: not known.
} top_history_t;

/// Notes what the snapshot says now; without one (a null pointer) that nothing is known.
void top_history_take(top_history_t *self, int64_t now_us, const json_t *state);

/// From this width on lines are whole.
#define TOP_COLUMNS_WHOLE 72

/// What is shown.
typedef struct {
    json_t *state; ///< The last snapshot; null: none yet.
    char last_stop[TOP_TEXT_SIZE];
    char notice[TOP_TEXT_SIZE]; ///< The answer to the last key, or why there is no gateway.
    bool connected;
    bool stale;                   ///< Connected, but nothing came for a while.
    int scale_mm_s;               ///< Of the bars.
    bool colour;                  ///< Else tones are bold, reverse and dim only.
    bool fine_blocks;             ///< The terminal shows UTF-8.
    const top_history_t *history; ///< Null: none.
} top_model_t;

/// Draws the whole screen with ncurses, which must be running. Does not refresh it.
void top_draw(const top_model_t *model);

/// Formatted text at a place, cut at the right margin.
__attribute__((format(printf, 5, 6))) void top_put(const top_model_t *model, int row, int column, top_tone_t tone,
                                                   const char *format, ...);

/// A word in letters of five rows; its width in columns is 6 for each letter. Draws only letters it has.
void top_put_big(const top_model_t *model, int row, top_tone_t tone, const char *word);

/// Text broken between words into at most `rows` rows, the last one cut. How many rows it took.
int top_put_wrapped(const top_model_t *model, int row, int rows, top_tone_t tone, const char *text);

/// Both wheels; `brief` leaves out their numbers. How many rows they took.
int top_draw_wheels(const top_model_t *model, int row, bool brief);

/// Bus, gaps, ledger and warnings, as far as they go into `rows`. How many they took.
int top_draw_rest(const top_model_t *model, int row, int rows);

/// The last minute, if `rows` are enough for it.
void top_draw_plots(const top_model_t *model, int row, int rows);

/// The scale that shows a speed: a round number, never smaller than the one before.
int top_scale(int before_mm_s, const json_t *state);

#endif
