import js from "@eslint/js";
import { defineConfig } from "eslint/config";
import typescript from "typescript-eslint";

export default defineConfig(
  { files: ["src/**/*.ts", "tests/**/*.ts"] },
  js.configs.recommended,
  typescript.configs.strict,
  {
    rules: {
      "no-undef": "off",
      // Indices into arrays of numbers are checked by the length of what is read.
      "@typescript-eslint/no-non-null-assertion": "off",
      "@typescript-eslint/no-unused-expressions": ["error", { allowTernary: true, allowShortCircuit: true }],
    },
  },
);
