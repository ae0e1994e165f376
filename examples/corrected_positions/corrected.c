/* Corrects a robot's reported joint positions by a model that `catenary export --model MODEL --c model.h` wrote.

   A line in is a tick: the reported positions q [rad, m], then the model's signals in the order that model.h tells (for a
   model of positions alone the same numbers again). A line out: the corrected positions, then for each whether the model
   is inside of what it was trained on (1) or a fixed offset was added (0). An empty line begins another motion. */
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>

#include "model.h"

enum { LONGEST = 65536 };

/* Reads `count` numbers; returns what stands behind them, or NULL where there are fewer. */
static char *numbers(char *text, int count, double *values) {
  int k;
  for (k = 0; k < count; ++k) {
    char *end;
    values[k] = strtod(text, &end);
    if (end == text) return NULL;
    text = end;
  }
  return text;
}

static int is_blank(const char *text) {
  while (isspace((unsigned char)*text)) ++text;
  return *text == '\0';
}

int main(void) {
  static char line[LONGEST];
  double q[MODEL_JOINTS], signals[MODEL_SIGNALS], corrected[MODEL_JOINTS];
  int inside[MODEL_JOINTS], j;
  long row = 0;
  model_state state;
  model_reset(&state);
  while (fgets(line, sizeof line, stdin) != NULL) {
    char *rest;
    ++row;
    if (is_blank(line)) {
      model_reset(&state);
      continue;
    }
    rest = numbers(line, MODEL_JOINTS, q);
    if (rest != NULL) rest = numbers(rest, MODEL_SIGNALS, signals);
    if (rest == NULL || !is_blank(rest)) {
      fprintf(stderr, "line %ld: expected %d positions and %d signals\n", row, MODEL_JOINTS, MODEL_SIGNALS);
      return 2;
    }
    model_correct(&state, q, signals, corrected, inside);
    for (j = 0; j < MODEL_JOINTS; ++j) printf("%.17g ", corrected[j]);
    for (j = 0; j < MODEL_JOINTS; ++j) printf("%d%s", inside[j], j + 1 < MODEL_JOINTS ? " " : "\n");
  }
  return 0;
}
