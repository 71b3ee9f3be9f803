// SPDX-License-Identifier: MIT
/// The live screen of `top`: what is drawn from the last snapshot, on whatever terminal there is.
///
/// 80 x 24 show everything, with the state in letters that can be read across a room. Smaller terminals lose what is least
/// needed first; below 20 x 4 there is only the state. Texts of other programs are cleaned before they are drawn.
#ifndef TOP_H
#define TOP_H

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>

#define TOP_TEXT_SIZE 512U

typedef enum { TOP_PLAIN = 0, TOP_TITLE, TOP_GOOD, TOP_CARE, TOP_BAD, TOP_FAINT, TOP_TONES } top_tone_t;

/// What is shown.
typedef struct {
    json_t *state; ///< The last snapshot; null: none yet.
    char last_stop[TOP_TEXT_SIZE];
    char notice[TOP_TEXT_SIZE]; ///< The answer to the last key, or why there is no gateway.
    bool connected;
    bool stale;       ///< Connected, but nothing came for a while.
    int scale_mm_s;   ///< Of the bars.
    bool colour;      ///< Else tones are bold, reverse and dim only.
    bool fine_blocks; ///< The terminal shows UTF-8.
} top_model_t;

/// Draws the whole screen with ncurses, which must be running. Does not refresh it.
void top_draw(const top_model_t *model);

/// Attributes of a tone, on this terminal.
void top_tone_begin(const top_model_t *model, top_tone_t tone);
void top_tone_end(const top_model_t *model, top_tone_t tone);

/// Formatted text at a place, cut at the right margin.
__attribute__((format(printf, 5, 6))) void top_put(const top_model_t *model, int row, int column, top_tone_t tone,
                                                   const char *format, ...);

/// A word in letters of five rows; its width in columns is 6 for each letter. Draws only letters it has.
void top_put_big(const top_model_t *model, int row, top_tone_t tone, const char *word);

/// The rows of both wheels, `rows` of them from `row` on, and those of bus, gaps, ledger and warnings.
void top_draw_wheels(const top_model_t *model, int row, bool brief);
void top_draw_rest(const top_model_t *model, int row, int rows);

/// The scale that shows a speed: a round number, never smaller than the one before.
int top_scale(int before_mm_s, const json_t *state);

#endif
