/* What text.h makes of arrays of numbers, one a line. */

#include "text.h"

#define LINES(name, call) \
    size_t name##_lines(const double *values, size_t count, int precision, char *array, size_t size) { \
        q_text text = q_text_in(array, size); \
        (void)precision; \
        for (size_t k = 0; k < count; k++) { \
            call; \
            q_text_add(&text, "\n", 1); \
        } \
        return text.length; \
    }

LINES(repr, q_text_repr(&text, values[k]))
LINES(general, q_text_general(&text, values[k], precision))
LINES(fixed, q_text_fixed(&text, values[k], precision))
LINES(exponential, q_text_exponential(&text, values[k], precision))

size_t integer_text(int64_t value, char *array, size_t size) {
    q_text text = q_text_in(array, size);
    q_text_integer(&text, value);
    q_text_string(&text, " ");
    q_text_boolean(&text, value > 0);
    return text.length;
}

/* The two strings one after the other, as far as the array takes them. */
size_t joined(const char *first, const char *second, char *array, size_t size) {
    q_text text = q_text_in(array, size);
    q_text_string(&text, first);
    q_text_string(&text, second);
    return text.length;
}
